"""A clock that jumps, and one that does not run backwards all the same."""

from __future__ import annotations

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.errors import DeviceDataError
from robot.host.clock import MAX_GAP, SteadyClock, WallClock
from sim_robot.electronics.clock import HostClock
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


def test_ordinary_delay_is_no_jump() -> None:
    below = InstantClock()
    clock = SteadyClock(below)
    clock.watch()
    for _ in range(10):
        clock.sleep(MAX_GAP * 0.9)
        clock.check()


@pytest.mark.parametrize(("jump", "words"), [(10, r"jumped by \+10"), (-3, r"jumped by -3\.0")])
def test_a_jump_is_noticed_once(jump: int, words: str) -> None:
    host = HostClock(InstantClock())
    clock = SteadyClock(host)
    clock.watch()
    host.inject("jump", jump)
    with pytest.raises(DeviceDataError, match=words):
        clock.check()
    clock.check()


def test_what_happened_before_is_forgotten() -> None:
    host = HostClock(InstantClock())
    clock = SteadyClock(host)
    host.inject("jump", 100)
    host.inject("jump", -50)
    clock.watch()
    clock.check()


@given(st.lists(st.tuples(st.integers(-100, 100), st.floats(0, 10)), max_size=20))
def test_it_never_runs_backwards_and_loses_no_time_that_passed(
    steps: list[tuple[int, float]],
) -> None:
    host = HostClock(InstantClock())
    clock = SteadyClock(host)
    for jump, passed in steps:
        host.inject("jump", jump)
        before = clock.now()
        host.sleep(passed)
        assert clock.now() - before == pytest.approx(passed, abs=1e-9)
