"""Fixtures of the examination."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import pytest

from bench.still_robot import still_robot
from tests.robot.clocks import InstantClock
from tests.robot.diagnosis.clinic import Clinic


@pytest.fixture
def clinic() -> Iterator[Clinic]:
    """A robot that lies flat; nobody else has its serial line open."""
    clock = InstantClock()
    with still_robot(clock, housekeeping=None, log=logging.getLogger("test")) as robot:
        robot.servos.close()
        yield Clinic(robot, clock)
