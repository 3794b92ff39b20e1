"""Six positions find zero, gain and sign of each axis, however carelessly; level finds zeros."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pytest

from robot.calibration import sensors
from robot.calibration.questions import Questions
from robot.calibration.sensors import POSITIONS, SAMPLES, placements, sample_at_rest
from robot.configuration.calibration_file import (
    AxesCalibration,
    DistanceCalibration,
    GaugeCalibration,
)
from robot.drivers.sensors.analogue import AnalogueAccelerometer, AnalogueAxes, StrainGauge
from robot.drivers.sensors.vl6180x import VL6180XSettings
from robot.errors import AbandonedError
from robot.sensing.samples import sample_channel
from robot.sensing.sensors import BellySensor, TouchPoint
from robot.uncertainty import Uncertainty
from tests.robot.calibration.desk import Answer, Inputs, Script
from tests.robot.clocks import InstantClock

AXES = AnalogueAxes(channels=(1, 2, 3), zero=(2.5, 2.5, 2.5), per_g=(1.0, 1.0, 1.0))
ZERO, GAIN = (2.3, 2.6, 2.5), (-0.9, 1.2, 0.8)


class Body:
    """Feels gravity along its axes, on channels 1 to 3."""

    def __init__(self, wires: tuple[int, ...] = (0, 1, 2)):
        self.inputs = Inputs(0, 0, 0, 0)
        self.wires = wires
        self.put(0, 0, 1)

    def put(self, *up: float) -> None:
        length = math.hypot(*up)
        for channel, axis in enumerate(self.wires):
            self.inputs.volts[1 + channel] = ZERO[axis] + GAIN[axis] * up[axis] / length

    def into(self, axis: int, sign: float, lean: float = 0.0) -> Callable[[], None]:
        up = [lean, lean, lean]
        up[axis] = sign
        return lambda: self.put(*up)

    def six(self, lean: float = 0.0) -> list[Answer]:
        return [(self.into(axis, sign, lean), "") for _, axis, sign in POSITIONS]


def calibrate_axes(body: Body, script: Script, axes: AnalogueAxes = AXES) -> AxesCalibration | None:
    driver = AnalogueAccelerometer(axes, body.inputs.connected(dict(enumerate("xyz", 1))))
    sample = partial(sample_at_rest, driver, rate=50, clock=InstantClock())
    return sensors.calibrate_accelerometer(axes, sample, Questions(script))


def test_an_axis_at_its_rail_is_measured_again() -> None:
    body = Body()
    first, *others = body.six()
    loose = (lambda: body.inputs.volts.__setitem__(1, 9.0), "")
    calibration = calibrate_axes(body, Script("six", loose, first, *others))
    assert calibration is not None
    assert calibration.zero == pytest.approx(ZERO, abs=1e-3)


def test_six_positions_find_zero_gain_and_sign() -> None:
    body = Body()
    calibration = calibrate_axes(body, Script("six", *body.six()))
    assert calibration is not None
    assert calibration.zero == pytest.approx(ZERO, abs=1e-3)
    assert calibration.per_g == pytest.approx(GAIN, abs=1e-3)


def test_leaning_by_3_degrees_costs_little() -> None:
    body = Body()
    calibration = calibrate_axes(body, Script("six", *body.six(lean=math.tan(math.radians(3)))))
    assert calibration is not None
    # cos 3° twice (two axes lean): 0.3 % of the gain, 0.1° at 30°.
    assert calibration.per_g == pytest.approx(GAIN, rel=4e-3)
    assert calibration.uncertainty.gain == pytest.approx(math.hypot(0.005, 0.0028), rel=0.02)
    assert calibration.uncertainty.zero is None  # where the board sits askew does not show


def test_a_position_that_leans_too_much_is_asked_for_again() -> None:
    body = Body()
    six = body.six()
    six[2] = (body.into(1, 1, 0.3), "")
    script = Script("six", *six, (body.into(1, 1), ""))
    calibration = calibrate_axes(body, script)
    assert script.heard("'left side up'")
    assert script.prompts[-1].startswith("left side up")
    assert calibration is not None
    assert calibration.per_g == pytest.approx(GAIN, abs=1e-3)


def test_swapped_wires_are_named() -> None:
    body = Body(wires=(1, 0, 2))
    script = Script("six", *body.six(), "skip")
    assert calibrate_axes(body, script) is None
    assert script.heard("The x axis answers on channel 2")


def test_an_axis_that_feels_nothing_is_named() -> None:
    body = Body()
    script = Script("six", *[("" if axis == 2 else body.six()[n]) for n, (_, axis, _) in
                             enumerate(POSITIONS)], "skip")  # fmt: skip
    assert calibrate_axes(body, script) is None
    assert script.heard("z axis")


def test_a_moving_robot_is_not_measured() -> None:
    body = Body()

    def hold_still() -> None:
        body.inputs.noise = 1e-4

    body.inputs.noise = 0.1
    script = Script("six", body.six()[0], (hold_still, ""), *body.six()[1:])
    assert calibrate_axes(body, script) is not None
    assert script.heard("not still")


def test_level_finds_the_zeros_whatever_the_table_leans() -> None:
    body = Body()
    lean = math.sin(math.radians(2))
    quarters: list[Answer] = [
        (lambda x=x, y=y: body.put(x, y, 1), "")  # type: ignore[misc]
        for x, y in ((lean, 0.0), (0.0, lean), (-lean, 0.0), (0.0, -lean))
    ]
    known = replace(AXES, uncertainty=Uncertainty(zero=1.0, gain=0.007))
    calibration = calibrate_axes(body, Script("level", *quarters), known)
    assert calibration is not None
    assert calibration.zero[:2] == pytest.approx(ZERO[:2], abs=1e-3)
    assert calibration.per_g == AXES.per_g
    assert calibration.uncertainty.gain == 0.007  # as it was
    assert calibration.uncertainty.zero == pytest.approx(math.radians(0.1), rel=0.05)
    rocked = [*quarters[:3], (lambda: body.put(0.0, -lean + 0.02, 1), "")]
    calibration = calibrate_axes(body, Script("level", *rocked), known)
    assert calibration is not None
    # half of 0.02 between the pairs, in one axis of two, whose gain is 1.2 times the one believed
    expected = math.hypot(math.radians(0.1), 1.2 * 0.01 / math.sqrt(8))
    assert calibration.uncertainty.zero == pytest.approx(expected, rel=0.05)


def test_level_refuses_what_it_cannot_know() -> None:
    body = Body()
    body.put(0.9, 0, 0.44)  # not level at all
    script = Script("level", "", "", "", "", "skip")
    assert calibrate_axes(body, script) is None
    assert script.heard("six positions")


def test_it_can_be_left_in_any_position() -> None:
    for position in range(len(POSITIONS)):
        body = Body()
        with pytest.raises(AbandonedError):
            calibrate_axes(body, Script("six", *body.six()[:position], "q"))


GAUGE = StrainGauge(channel=2, tare=0.2, volts_per_newton=0.2)
POINT = TouchPoint(name="foot", driver=GAUGE, on=0.1, off=0.05, debounce=3)


class Foot:
    """Carries a load on channel 2."""

    def __init__(self, gain: float, noise: float = 1e-4):
        self.gain = gain
        self.inputs = Inputs(0, 0, 0.35, noise=noise)

    def load(self, newtons: float) -> None:
        self.inputs.volts[2] = 0.35 + self.gain * newtons


def calibrate_gauge(foot: Foot, script: Script) -> GaugeCalibration | None:
    inputs = foot.inputs.connected({GAUGE.channel: "the gauge of foot"})
    sample = partial(
        sample_channel, inputs, GAUGE.channel, count=SAMPLES, rate=50, clock=InstantClock()
    )
    return sensors.calibrate_gauge(POINT, GAUGE.channel, sample, Questions(script))


@pytest.mark.parametrize("gain", [0.12, -0.3])
@pytest.mark.parametrize(("typed", "newtons"), [("1.5", 1.5), ("200 g", 1.962), ("200g", 1.962)])
def test_a_known_load_gives_the_gain(gain: float, typed: str, newtons: float) -> None:
    foot = Foot(gain)
    calibration = calibrate_gauge(foot, Script("", (lambda: foot.load(newtons), typed)))
    assert calibration is not None
    assert calibration.tare == pytest.approx(0.35, abs=1e-4)
    assert calibration.volts_per_newton == pytest.approx(gain, rel=2e-3)
    assert (calibration.on, calibration.off) == (0.1, 0.05)


@pytest.mark.parametrize(
    ("typed", "understood"),
    [("5", "5 N (510 g)"), ("50", "50 N (5097 g)"), ("200 g", "1.962 N (200 g)")],
)
def test_a_load_is_said_in_both_units(typed: str, understood: str) -> None:
    foot = Foot(0.05)
    script = Script("", (lambda: foot.load(5), typed))
    assert calibrate_gauge(foot, script) is not None
    assert script.heard(understood)


def test_a_noisy_foot_gets_a_higher_threshold_and_says_so() -> None:
    foot = Foot(0.1, noise=0.005)  # 0.05 N of noise; a threshold of 0.1 N would be crossed
    script = Script("", (lambda: foot.load(2), "2"))
    calibration = calibrate_gauge(foot, script)
    assert calibration is not None
    assert 0.25 < calibration.on < 0.4
    assert calibration.off == pytest.approx(calibration.on / 2)
    assert script.heard("noise")


def test_a_load_on_another_foot_is_noticed() -> None:
    foot = Foot(0.1)
    script = Script("", "1", (lambda: foot.load(1), "1"))
    calibration = calibrate_gauge(foot, script)
    assert script.heard("channel 2")
    assert calibration is not None
    assert calibration.volts_per_newton == pytest.approx(0.1, rel=2e-3)


def test_a_load_that_is_too_heavy_for_the_amplifier_is_asked_for_again() -> None:
    foot = Foot(0.2)
    heavy, light = (lambda: foot.load(50), "50"), (lambda: foot.load(2), "2")
    script = Script("", heavy, "", light)
    calibration = calibrate_gauge(foot, script)
    assert script.heard("input 2, the gauge of foot, is at the end of its range (5.000 V)")
    assert script.heard("too heavy a load")
    assert calibration is not None
    assert calibration.volts_per_newton == pytest.approx(0.2, rel=2e-3)


def test_a_free_foot_whose_input_is_at_its_rail_is_measured_again() -> None:
    foot = Foot(0.2)
    foot.load(-50)
    script = Script("", (lambda: foot.load(0), ""), (lambda: foot.load(2), "2"))
    calibration = calibrate_gauge(foot, script)
    assert script.heard("end of its range (-5.000 V)")
    assert calibration is not None
    assert calibration.tare == pytest.approx(0.35, abs=1e-4)


@pytest.mark.parametrize("load", ["0", "-1", "100", "900", "6000 g", "heavy", "g", ""])
def test_an_impossible_load_is_asked_for_again(load: str) -> None:
    foot = Foot(0.1)
    script = Script("", load, (lambda: foot.load(1), "1"))
    assert calibrate_gauge(foot, script) is not None
    assert len(script.prompts) == 3
    assert script.heard("'100 g'")


def test_a_gauge_can_be_skipped() -> None:
    assert calibrate_gauge(Foot(0.1), Script("skip")) is None


BELLY = BellySensor(driver=VL6180XSettings(bus=1, address=0x29), zero=0.010, reach=0.2)


class Ruler:
    """Reads whole millimetres, with its own zero and scale, and an error at each placement."""

    name = "ruler"

    def __init__(self, rms: float = 1.0):
        self.rms = rms
        self.height: float | None = None
        self.offset = 0.0
        self._random = random.Random(3)

    def put(self, height: float | None) -> None:
        self.height = height
        self.offset = self._random.gauss(0, self.rms)

    def start(self) -> None:
        """It is there."""

    def check(self) -> None:
        """It works."""

    def close(self) -> None:
        """There is no link."""

    def distance(self) -> float | None:
        if self.height is None:
            return None
        return round(14.2 + self.height / 0.97 + self.offset + self._random.gauss(0, 0.3)) / 1000


def calibrate_distance(
    ruler: Ruler, script: Script, noise: float = 1e-3
) -> DistanceCalibration | None:
    return sensors.calibrate_distance(BELLY, ruler, noise, Questions(script))


def placed(ruler: Ruler, height: float, times: int) -> list[Answer]:
    return [(lambda: ruler.put(height), "")] * times


def test_many_placements_find_zero_and_scale() -> None:
    ruler = Ruler()
    script = Script("", *placed(ruler, 0, 16), "150", *placed(ruler, 150, 16))
    calibration = calibrate_distance(ruler, script)
    assert script.left == 0
    assert calibration is not None
    sensor = replace(BELLY, zero=calibration.zero, scale=calibration.scale)
    for height in (0, 75, 150):  # four standard errors
        assert sensor.clearance((14.2 + height / 0.97) / 1000) == pytest.approx(
            height / 1000, abs=1e-3
        )
    zero, gain = calibration.uncertainty.zero, calibration.uncertainty.gain
    assert zero == pytest.approx(math.hypot(0.29e-3, 0.25e-3), rel=0.2)
    assert gain == pytest.approx(math.hypot(math.sqrt(2) * 0.38, 0.5) / 150, rel=0.2)


@pytest.mark.parametrize(("noise", "times"), [(0.1e-3, 3), (1e-3, 16), (1.0, 25)])
def test_a_noisier_sensor_is_placed_more_often(noise: float, times: int) -> None:
    assert placements(noise) == times


def test_three_placements_are_the_least() -> None:
    ruler = Ruler(rms=0.1)
    script = Script(
        "", *placed(ruler, 0, 2), "done", *placed(ruler, 0, 1), "done",
        "100", *placed(ruler, 100, 4), "done",
    )  # fmt: skip
    calibration = calibrate_distance(ruler, script)
    assert script.left == 0
    assert calibration is not None
    assert calibration.scale == pytest.approx(0.97, abs=0.01)
    known = calibration.uncertainty.zero
    assert known == pytest.approx(
        math.hypot(0.29e-3, 1e-3 / math.sqrt(4)), rel=0.01
    )  # as announced


def test_a_plate_at_another_height_than_said_is_noticed() -> None:
    ruler = Ruler()
    script = Script(
        "", *placed(ruler, 0, 3), "done", "100", *placed(ruler, 30, 3), "done",
        "100", *placed(ruler, 100, 3), "done",
    )  # fmt: skip
    assert calibrate_distance(ruler, script) is not None
    assert script.heard("Measure from the belly")


def test_a_sensor_without_a_target_is_asked_again() -> None:
    ruler = Ruler()
    script = Script("", (lambda: ruler.put(None), ""), (lambda: ruler.put(0), ""))
    with pytest.raises(AbandonedError):
        calibrate_distance(ruler, script)
    assert script.heard("no target")


class Blinking(Ruler):
    """Sees nothing in some of ten measurements."""

    def __init__(self, blind: int):
        super().__init__(rms=0.0)
        self._blind = blind
        self._measurements = 0

    def distance(self) -> float | None:
        self._measurements += 1
        return None if self._measurements % 10 < self._blind else super().distance()


def test_a_placement_is_that_of_the_measurements_that_saw_something() -> None:
    ruler = Blinking(5)
    script = Script("", *placed(ruler, 0, 3), "done", "100", *placed(ruler, 100, 3), "done")
    calibration = calibrate_distance(ruler, script)
    assert calibration is not None
    assert calibration.zero == pytest.approx(0.0142, abs=5e-4)
    assert not script.heard("no target")


def test_a_placement_that_is_mostly_not_seen_is_measured_again() -> None:
    ruler = Blinking(6)
    script = Script("", (lambda: ruler.put(0), ""))
    with pytest.raises(AbandonedError):
        calibrate_distance(ruler, script)
    assert script.heard("no target")


def test_it_can_be_skipped() -> None:
    assert calibrate_distance(Ruler(), Script("skip")) is None
