"""Touch: hysteresis, debounce, either sign of mounting."""

from __future__ import annotations

from robot.sensing.touch import TouchDetector, TouchGauge


def detector(gain: float = 0.2) -> TouchDetector:
    return TouchDetector(
        TouchGauge(
            name="foot", channel=0, tare=0.5, volts_per_newton=gain, on=0.1, off=0.05, debounce=3
        )
    )


def feed(found: TouchDetector, newtons: float, times: int) -> bool:
    gauge = found.gauge
    return [found.feed(gauge.tare + newtons * gauge.volts_per_newton) for _ in range(times)][-1]


def test_the_bit_needs_three_samples_in_a_row() -> None:
    found = detector()
    assert not feed(found, 1.0, 2)
    assert not feed(found, 0.0, 1)
    assert not feed(found, 1.0, 2)
    assert feed(found, 1.0, 1)


def test_between_the_thresholds_the_bit_stays() -> None:
    found = detector()
    assert not feed(found, 0.07, 10)
    assert feed(found, 0.2, 3)
    assert feed(found, 0.07, 10)
    assert not feed(found, 0.04, 3)


def test_a_gauge_that_is_mounted_the_other_way_round() -> None:
    found = detector(gain=-0.2)
    assert feed(found, 1.0, 3)
    assert not feed(found, -1.0, 3)
