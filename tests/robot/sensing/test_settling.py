"""Rest: neither swinging nor drifting."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from robot.sensing.settling import RestCriterion, RestDetector

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
