"""One run of the method posterior for all tests of the live page, and such a page."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.estimator.report.live.followed_run import FollowedRun, follow_run

if TYPE_CHECKING:
    from estimator.report.live.live_page import LivePage


@pytest.fixture(scope="package")
def followed(tmp_path_factory: pytest.TempPathFactory) -> FollowedRun:
    """A robot's four lengths, identified."""
    folder = tmp_path_factory.mktemp("followed")
    return folder / "run", follow_run(folder, "posterior")


@pytest.fixture
def live() -> Iterator[LivePage]:
    """A page on the loopback interface, which shows nothing yet."""
    from estimator.report.live.live_page import (
        LivePage,  # takes a second; others need not wait for it
    )

    with closing(LivePage(Path("runs/mine"), "127.0.0.1", 0)) as page:
        yield page
