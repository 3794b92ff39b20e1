"""What an average of samples makes of the sensors."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from protocol.wire.readings import clearance_of, tilt_of
from robot.drivers.sensors.analogue import StrainGauge
from robot.drivers.sensors.vl6180x import VL6180XSettings
from robot.errors import DeviceDataError
from robot.sensing.sensors import (
    LEAST_MARGIN,
    BellySensor,
    RobotSensors,
    TouchDetector,
    TouchPoint,
    Underside,
)
from tests.robot.clocks import InstantClock
from tests.robot.sensing.resting import Leaning, Ruler

BELLY = BellySensor(driver=VL6180XSettings(bus=1, address=0x29), zero=0.0, reach=0.15)
WIDE = Underside(size=(1.0, 1.0))  # its middle is 0.18 m up when it leans by 20°


def sensing(metres: float | None) -> RobotSensors:
    return RobotSensors(
        accelerometer=Leaning(),
        touch=(),
        belly=(Ruler(metres), BELLY),
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


def test_without_an_accelerometer_there_is_no_tilt_and_nothing_to_contradict() -> None:
    sensors = RobotSensors(
        accelerometer=None,
        touch=(),
        belly=(Ruler(0.1), BELLY),
        clock=InstantClock(),
        rate=50.0,
        underside=WIDE,
    )
    assert sensors.tilt() is None
    reading = sensors.average(10)
    assert reading.tilt is None
    assert reading.clearance == pytest.approx(0.1)


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
    reading = RobotSensors(
        accelerometer=Leaning((x, y, z)),
        touch=(),
        belly=(Ruler(millimetres / 1000), BELLY),
        clock=InstantClock(),
        rate=50.0,
    ).average(1)
    assert reading.tilt == pytest.approx(tilt_of((x, y, z)), abs=1e-7)  # asin is steep at its ends
    assert (reading.clearance, reading.clearance_saturated) == clearance_of(
        BELLY.clearance(millimetres / 1000), BELLY.reach
    )


GAUGE = StrainGauge(channel=0, tare=0.5, volts_per_newton=0.2)


def detector() -> TouchDetector:
    return TouchDetector(TouchPoint(name="foot", driver=GAUGE, on=0.1, off=0.05, debounce=3))


def feed(touch: TouchDetector, load: float | bool, times: int) -> bool:
    return [touch.feed(load) for _ in range(times)][-1]


def test_the_bit_needs_three_samples_in_a_row() -> None:
    touch = detector()
    assert not feed(touch, 1.0, 2)
    assert not feed(touch, 0.0, 1)
    assert not feed(touch, 1.0, 2)
    assert feed(touch, 1.0, 1)


def test_between_the_thresholds_the_bit_stays() -> None:
    touch = detector()
    assert not feed(touch, 0.07, 10)
    assert feed(touch, 0.2, 3)
    assert feed(touch, 0.07, 10)
    assert not feed(touch, 0.04, 3)


def test_a_gauge_that_is_mounted_the_other_way_round() -> None:
    gauge = replace(GAUGE, volts_per_newton=-0.2)
    assert gauge.force(0.3) == pytest.approx(1.0)


def test_a_switch_needs_no_threshold_and_is_debounced() -> None:
    touch = detector()
    assert not feed(touch, True, 2)
    assert feed(touch, True, 1)
    assert feed(touch, False, 2)
    assert not feed(touch, False, 1)


def test_a_belly_that_leans_is_not_on_the_ground() -> None:
    lean = math.radians(20)
    least = 0.14 / 2 * math.tan(lean)  # the lower edge on the ground, the middle above it
    belly = Underside(size=(0.2, 0.14))
    belly.check(least, (lean, 0.0), sensor="ruler")
    with pytest.raises(DeviceDataError, match=r"leans by 20° is at least 25 mm up"):
        belly.check(least - LEAST_MARGIN - 1e-6, (lean, 0.0), sensor="ruler")


def test_a_round_belly_has_no_corners() -> None:
    lean = math.radians(20) / math.sqrt(2)  # over what would be a corner
    least = (
        0.07 * math.hypot(math.sin(lean), math.sin(lean)) / math.sqrt(1 - 2 * math.sin(lean) ** 2)
    )
    belly = Underside(size=(0.14, 0.14), round=True)
    belly.check(least - LEAST_MARGIN + 1e-6, (lean, lean), sensor="ruler")
    with pytest.raises(DeviceDataError, match="at least 26 mm up"):
        belly.check(least - LEAST_MARGIN - 1e-6, (lean, lean), sensor="ruler")


@pytest.mark.parametrize(
    ("size", "tilt_deg", "clearance", "margin"),
    [
        ((0.14, 0.14), 0.0, 0.0, LEAST_MARGIN),
        ((0.14, 0.14), 0.3, 0.001, 0.01 + 5 * math.radians(0.3) * 0.14),
        ((1.0, 0.5), 0.3, 0.001, 0.01 + 5 * math.radians(0.3) * 0.75),
        ((0.14, 0.14), 0.0, 0.006, 0.06),
    ],
)
def test_sensors_that_err_as_announced_may_contradict_each_other(
    size: tuple[float, ...], tilt_deg: float, clearance: float, margin: float
) -> None:
    noise = math.radians(tilt_deg)
    belly = Underside(size=size, tilt_noise=noise, clearance_noise=clearance)
    lean = math.radians(20)
    least = size[1] / 2 * math.tan(lean)
    belly.check(least - margin + 1e-6, (lean, 0.0), sensor="ruler")
    with pytest.raises(DeviceDataError):
        belly.check(least - margin - 1e-6, (lean, 0.0), sensor="ruler")


@given(
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
    st.floats(0, 0.1),
    st.tuples(st.floats(0.01, 0.5), st.floats(0.01, 0.5)),
)
def test_no_body_above_the_ground_is_refused(
    roll: float, pitch: float, height: float, footprint: tuple[float, float]
) -> None:
    x, y = -math.sin(pitch), math.cos(pitch) * math.sin(roll)
    z = math.cos(pitch) * math.cos(roll)
    assume(z > 0.1)
    corners = [
        a * footprint[0] / 2 * x + b * footprint[1] / 2 * y for a in (-1, 1) for b in (-1, 1)
    ]
    middle = height - min(corners)  # the lowest corner is `height` above the ground
    belly = Underside(size=footprint)
    belly.check(middle / z, (math.asin(y), math.asin(x)), sensor="ruler")
