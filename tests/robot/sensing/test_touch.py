"""Touch: hysteresis, debounce, either sign of mounting."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robot.drivers.sensors.analogue import StrainGauge
from robot.sensing.touch import TouchDetector, TouchPoint

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
