from __future__ import annotations

import time

from robot.host.clock import WallClock
from tests.robot.clocks import InstantClock


def test_wall_clock_sleeps_and_is_not_moved_by_charges() -> None:
    clock = WallClock()
    start = clock.now()
    clock.sleep(0.01)
    clock.sleep(-1.0)
    clock.charge(1000.0)
    assert 0.01 <= clock.now() - start < 100.0


def test_stepped_clock_moves_by_exactly_what_is_slept_and_charged() -> None:
    clock = InstantClock(5.0)
    real = time.monotonic()
    clock.sleep(100.0)
    clock.charge(0.5)
    clock.sleep(-1.0)
    assert clock.now() == 105.5
    assert time.monotonic() - real < 10.0
