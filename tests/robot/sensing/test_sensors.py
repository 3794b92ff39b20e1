"""What an average of samples makes of the sensors."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.wire.readings import clearance_of, tilt_of
from robot.errors import DeviceDataError
from robot.host.clock import SteppedClock
from robot.sensing.plausibility import Underside
from robot.sensing.sensors import Accelerometer, BellySensor, Sensing

WIDE = Underside(length=1.0, width=1.0)  # its middle is 0.18 m up when it leans by 20°


class Leaning:
    """Inputs of a body that leans to the left by 20°, and dithers."""

    def __init__(self) -> None:
        self._dither = itertools.cycle((0.0, 1e-4))

    def scan(self, low: int, high: int) -> list[float]:
        error, lean = next(self._dither), math.radians(20)
        return [2.5 + error, 2.5 - math.sin(lean) + error, 2.5 + math.cos(lean) + error]


class Ruler:
    """A distance sensor that always says the same."""

    def __init__(self, millimetres: int | None):
        self._millimetres = millimetres

    def range_mm(self) -> int | None:
        return self._millimetres


def sensing(millimetres: int | None) -> Sensing:
    return Sensing(
        Leaning(),
        belly=(Ruler(millimetres), BellySensor(zero=0.0, reach=0.15)),
        accelerometer=Accelerometer(
            channels=(0, 1, 2), zero=(2.5, 2.5, 2.5), volts_per_g=(1.0, 1.0, 1.0)
        ),
        gauges=(),
        clock=SteppedClock(),
        rate=50.0,
        underside=WIDE,
    )


def test_a_distance_beyond_reach_contradicts_no_tilt() -> None:
    for millimetres in (None, 180):
        reading = sensing(millimetres).average(10)
        assert reading.clearance == 0.15
        assert reading.clearance_saturated


def test_a_distance_within_reach_may_contradict_the_tilt() -> None:
    with pytest.raises(DeviceDataError, match=r"says 100 mm.*leans by 20° is at least 182 mm up"):
        sensing(100).average(10)


def test_the_share_that_is_done_is_told() -> None:
    told: list[float] = []
    sensing(None).average(4, told.append)
    assert told == [0.0, 0.25, 0.5, 0.75, 1.0]


class Resting:
    """Inputs of a body at rest in some attitude."""

    def __init__(self, up: tuple[float, float, float]):
        self._up = up

    def scan(self, low: int, high: int) -> list[float]:
        return [2.5 + value for value in self._up]


@given(
    components=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda up: math.hypot(*up) > 0.1),
    millimetres=st.integers(0, 200),
)
def test_the_robot_reads_what_the_protocol_defines(
    components: tuple[float, float, float], millimetres: int
) -> None:
    length = math.hypot(*components)
    x, y, z = (part / length for part in components)
    sensor = BellySensor(zero=0.0, reach=0.15)
    reading = Sensing(
        Resting((x, y, z)),
        belly=(Ruler(millimetres), sensor),
        accelerometer=Accelerometer(
            channels=(0, 1, 2), zero=(2.5, 2.5, 2.5), volts_per_g=(1.0, 1.0, 1.0)
        ),
        gauges=(),
        clock=SteppedClock(),
        rate=50.0,
    ).average(1)
    assert reading.tilt == pytest.approx(tilt_of((x, y, z)), abs=1e-7)  # asin is steep at its ends
    assert (reading.clearance, reading.clearance_saturated) == clearance_of(
        sensor.clearance(millimetres), sensor.reach
    )
