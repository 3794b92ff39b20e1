"""Rest: neither swinging nor drifting."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from robot.errors import DeviceDataError
from robot.sensing.samples import (
    RestCriterion,
    RestDetector,
    sample_channel,
    spread,
)
from tests.robot.calibration.desk import Inputs
from tests.robot.clocks import InstantClock

CRITERION = RestCriterion()


def rest_time(
    tilt: Callable[[float], float], until: float = 5.0, *, late: float = 0.0
) -> float | None:
    """When the detector first reports rest for a tilt (degrees) over time (s)."""
    detector = RestDetector(CRITERION)
    for step in range(int(until * CRITERION.rate)):
        now = step * (1 / CRITERION.rate + late)
        if detector.feed(now, (0.0, math.radians(tilt(now)))):
            return now
    return None


def test_a_still_robot_rests_after_one_window() -> None:
    seconds = rest_time(lambda _: 3.0)
    assert seconds is not None
    assert 0.95 <= seconds <= 1.05


@pytest.mark.parametrize("late", [0.0, 0.0015, 0.01, 0.015])
def test_samples_that_take_time_are_as_good(late: float) -> None:
    """As on an I²C bus of 100 kHz, where a sample takes 1.5 ms, or on a busy computer."""
    seconds = rest_time(lambda _: 3.0, late=late)
    assert seconds is not None
    assert 0.95 <= seconds <= 1.05


def test_a_swinging_robot_does_not_rest_until_it_has_died_down() -> None:
    seconds = rest_time(lambda t: 5 * math.exp(-2 * t) * math.cos(30 * t))
    assert seconds is not None
    assert seconds > 1.0


@pytest.mark.parametrize(
    "tilt",
    [
        lambda t: 0.25 * t,  # °/s
        lambda t: 0.4 * t**2,  # legs of a thousand times the inertia that they can have
        lambda t: min(30.0, 0.02 * math.exp(t / 0.3)),  # off the edge that it is balanced on
        lambda t: 0.7 * math.cos(math.pi * t),  # a tall robot rocks, and turns back
    ],
    ids=["drifts", "speeds up", "tips over", "rocks"],
)
def test_slow_motion_is_not_rest(tilt: Callable[[float], float]) -> None:
    seconds = rest_time(tilt)
    assert seconds is None or tilt(seconds) == tilt(100)  # where it came to lie


def test_a_gap_in_the_samples_is_not_rest() -> None:
    detector = RestDetector(CRITERION)
    assert not detector.feed(0.0, (0.0, 0.0))
    assert not detector.feed(10.0, (0.0, 0.0))
    assert not detector.feed(10.02, (0.0, 0.0))


def test_a_spread_by_hand() -> None:
    by_hand = spread([1.0, 2.0, 3.0, 6.0])
    assert (by_hand.mean, by_hand.least, by_hand.most, by_hand.count) == (3.0, 1.0, 6.0, 4)
    assert by_hand.deviation == pytest.approx((14 / 3) ** 0.5)  # 4 + 1 + 0 + 9, over n − 1
    assert spread([5.0]).deviation == 0.0


def test_a_channel_is_sampled_at_the_rate_and_picked_out() -> None:
    class Counting(Inputs):
        scans = 0

        def scan(self, low: int, high: int) -> list[float]:
            assert (low, high) == (2, 5)
            self.scans += 1
            return [float(self.scans), 0.0, 0.0, 9.0]

    clock, inputs = InstantClock(), Counting().connected({2: "one", 5: "another"})
    assert sample_channel(inputs, 2, count=4, rate=50, clock=clock).mean == 2.5
    assert clock.now() == pytest.approx(4 / 50)


def test_a_channel_that_cannot_be_believed_is_not_sampled() -> None:
    inputs = Inputs(0, 0, 9).connected({2: "a gauge"})
    with pytest.raises(DeviceDataError, match="input 2, a gauge, is at the end of its range"):
        sample_channel(inputs, 2, count=4, rate=50, clock=InstantClock())
