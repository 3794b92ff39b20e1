"""A gauge: its tare, its sensitivity with its sign, and a threshold above its noise."""

from __future__ import annotations

import pytest

from robot.calibration.questions import Questions
from robot.calibration.strain_gauges import GaugeSession
from robot.configuration.calibration_file import GaugeCalibration
from robot.drivers.sensors.analogue import StrainGauge
from robot.sensing.sensors import TouchPoint
from tests.robot.calibration.desk import Inputs, Script
from tests.robot.clocks import InstantClock

GAUGE = StrainGauge(channel=2, tare=0.2, volts_per_newton=0.2)
BELIEVED = TouchPoint(name="foot", driver=GAUGE, on=0.1, off=0.05, debounce=3)


class Foot:
    """Carries a load on channel 2."""

    def __init__(self, gain: float, noise: float = 1e-4):
        self.gain = gain
        self.inputs = Inputs(0, 0, 0.35, noise=noise)

    def load(self, newtons: float) -> None:
        self.inputs.volts[2] = 0.35 + self.gain * newtons


def run(foot: Foot, script: Script) -> GaugeCalibration | None:
    return GaugeSession(
        BELIEVED,
        GAUGE.channel,
        foot.inputs.connected({GAUGE.channel: "the gauge of foot"}),
        rate=50,
        clock=InstantClock(),
        dialogue=Questions(script),
    ).run()


@pytest.mark.parametrize("gain", [0.12, -0.3])
@pytest.mark.parametrize(("typed", "newtons"), [("1.5", 1.5), ("200 g", 1.962), ("200g", 1.962)])
def test_a_known_load_gives_the_gain(gain: float, typed: str, newtons: float) -> None:
    foot = Foot(gain)
    calibration = run(foot, Script("", (lambda: foot.load(newtons), typed)))
    assert calibration is not None
    assert calibration.tare == pytest.approx(0.35, abs=1e-4)
    assert calibration.volts_per_newton == pytest.approx(gain, rel=2e-3)
    assert (calibration.on, calibration.off) == (0.1, 0.05)


def test_a_noisy_foot_gets_a_higher_threshold_and_says_so() -> None:
    foot = Foot(0.1, noise=0.005)  # 0.05 N of noise; a threshold of 0.1 N would be crossed
    script = Script("", (lambda: foot.load(2), "2"))
    calibration = run(foot, script)
    assert calibration is not None
    assert 0.25 < calibration.on < 0.4
    assert calibration.off == pytest.approx(calibration.on / 2)
    assert script.heard("noise")


def test_a_load_on_another_foot_is_noticed() -> None:
    foot = Foot(0.1)
    script = Script("", "1", (lambda: foot.load(1), "1"))
    calibration = run(foot, script)
    assert script.heard("channel 2")
    assert calibration is not None
    assert calibration.volts_per_newton == pytest.approx(0.1, rel=2e-3)


def test_a_load_that_is_too_heavy_for_the_amplifier_is_asked_for_again() -> None:
    foot = Foot(0.2)
    heavy, light = (lambda: foot.load(50), "50"), (lambda: foot.load(2), "2")
    script = Script("", heavy, "", light)
    calibration = run(foot, script)
    assert script.heard("input 2, the gauge of foot, is at the end of its range (5.000 V)")
    assert script.heard("too heavy a load")
    assert calibration is not None
    assert calibration.volts_per_newton == pytest.approx(0.2, rel=2e-3)


def test_a_free_foot_whose_input_is_at_its_rail_is_measured_again() -> None:
    foot = Foot(0.2)
    foot.load(-50)
    script = Script("", (lambda: foot.load(0), ""), (lambda: foot.load(2), "2"))
    calibration = run(foot, script)
    assert script.heard("end of its range (-5.000 V)")
    assert calibration is not None
    assert calibration.tare == pytest.approx(0.35, abs=1e-4)


@pytest.mark.parametrize("load", ["0", "-1", "900", "heavy", "g", ""])
def test_an_impossible_load_is_asked_for_again(load: str) -> None:
    foot = Foot(0.1)
    script = Script("", load, (lambda: foot.load(1), "1"))
    assert run(foot, script) is not None
    assert len(script.prompts) == 3


def test_a_gauge_can_be_skipped() -> None:
    assert run(Foot(0.1), Script("skip")) is None
