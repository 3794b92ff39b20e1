"""Fixtures of the robot's tests."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import pytest

from bench.still_robot import still_robot
from tests.robot.stepped import Bench, SteppedClock


@pytest.fixture
def bench() -> Iterator[Bench]:
    clock = SteppedClock()
    with still_robot(clock, housekeeping=None, log=logging.getLogger("test")) as robot:
        stepped = Bench(robot, clock)
        robot.controller.set_notify(stepped.notify)
        robot.controller.start()
        yield stepped
        clock.free()
        assert robot.controller.shut_down()
