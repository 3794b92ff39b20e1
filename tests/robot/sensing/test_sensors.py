"""What an average of samples makes of the sensors."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.wire.readings import clearance_of, tilt_of
from robot.errors import DeviceDataError
from robot.sensing.plausibility import Underside
from robot.sensing.sensors import BellySensor, Sensing
from tests.robot.clocks import InstantClock
from tests.robot.sensing.resting import Leaning, Ruler

WIDE = Underside(length=1.0, width=1.0)  # its middle is 0.18 m up when it leans by 20°


def sensing(metres: float | None) -> Sensing:
    return Sensing(
        accelerometer=Leaning(),
        touch=(),
        belly=(Ruler(metres), BellySensor(zero=0.0, reach=0.15)),
        clock=InstantClock(),
        rate=50.0,
        underside=WIDE,
    )


def test_a_distance_beyond_reach_contradicts_no_tilt() -> None:
    for metres in (None, 0.18):
        reading = sensing(metres).average(10)
        assert reading.clearance == 0.15
        assert reading.clearance_saturated


def test_a_distance_within_reach_may_contradict_the_tilt() -> None:
    with pytest.raises(
        DeviceDataError, match=r"\(ruler\) says 100 mm.*leans by 20° is at least 182 mm up"
    ):
        sensing(0.1).average(10)


def test_the_share_that_is_done_is_told() -> None:
    told: list[float] = []
    sensing(None).average(4, told.append)
    assert told == [0.0, 0.25, 0.5, 0.75, 1.0]


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
        accelerometer=Leaning((x, y, z)),
        touch=(),
        belly=(Ruler(millimetres / 1000), sensor),
        clock=InstantClock(),
        rate=50.0,
    ).average(1)
    assert reading.tilt == pytest.approx(tilt_of((x, y, z)), abs=1e-7)  # asin is steep at its ends
    assert (reading.clearance, reading.clearance_saturated) == clearance_of(
        sensor.clearance(millimetres / 1000), sensor.reach
    )
