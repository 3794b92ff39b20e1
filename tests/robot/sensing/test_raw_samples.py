"""Statistics of raw samples."""

from __future__ import annotations

import pytest

from robot.errors import DeviceDataError
from robot.sensing.raw_samples import sample_channel, sample_distance, spread
from tests.robot.calibration.desk import Inputs
from tests.robot.clocks import InstantClock
from tests.robot.sensing.resting import Leaning


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


class Finder(Leaning):
    def __init__(self, *values: float | None):
        self._values = list(values)

    def distance(self) -> float | None:
        return self._values.pop(0)


def test_a_distance_is_that_of_the_measurements_that_saw_something() -> None:
    distance = sample_distance(Finder(10, None, 12, None), count=4)
    assert distance is not None
    assert (distance.mean, distance.count) == (11.0, 2)


def test_a_distance_that_is_mostly_not_seen_is_none() -> None:
    assert sample_distance(Finder(10, None, None), count=3) is None
