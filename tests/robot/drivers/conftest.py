from __future__ import annotations

import pytest

from tests.robot.clocks import InstantClock


@pytest.fixture
def clock() -> InstantClock:
    return InstantClock()
