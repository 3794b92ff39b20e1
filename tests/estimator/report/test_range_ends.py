"""Lengths that readings press against an end of their range, told from those that merely reach it.

Distances are from the end, relative to the range.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import truncnorm

from estimator.body.morphology import Array
from estimator.report.range_ends import is_pressed

EQUAL = np.full(2_000, 1 / 2_000)
QUANTILES = (np.arange(2_000) + 0.5) / 2_000
ONE = np.array([0.08])
TWO = np.array([0.19, 0.19])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def bell(rng: np.random.Generator, peak: float, width: float) -> Array:
    """Distances with a bell-shaped density that the ends cut off."""
    low, high = -peak / width, (1 - peak) / width
    drawn: Array = truncnorm.rvs(low, high, peak, width, size=2_000, random_state=rng)
    return drawn[:, None]


@pytest.mark.parametrize("standard_deviations", [0.0, -0.5, -2.0, -4.0])
def test_a_length_whose_truth_lies_at_the_end_or_beyond_is_pressed(
    rng: np.random.Generator, standard_deviations: float
) -> None:
    assert is_pressed(bell(rng, 0.05 * standard_deviations, 0.05), ONE, EQUAL)


@pytest.mark.parametrize("standard_deviations", [1.5, 2.0, 4.0])
def test_a_length_whose_density_falls_off_before_the_end_is_not(
    rng: np.random.Generator, standard_deviations: float
) -> None:
    assert not is_pressed(bell(rng, 0.05 * standard_deviations, 0.05), ONE, EQUAL)


def test_a_peak_before_the_end_with_a_tail_away_from_it_is_not() -> None:
    distances = 0.02 + 0.06 * QUANTILES**4
    assert not is_pressed(distances[:, None], ONE, EQUAL)


def test_a_length_of_which_readings_say_nothing_near_the_end_is_not() -> None:
    """One that touched nothing may be all that is too short, or any."""
    for farthest in (0.25, 1.0):
        assert not is_pressed(farthest * QUANTILES[:, None], ONE, EQUAL)
    vague = -0.3 * np.log1p(-0.95 * QUANTILES)
    assert not is_pressed(vague[:, None], ONE, EQUAL)


def test_of_lengths_whose_sum_is_known_none_is_pressed(rng: np.random.Generator) -> None:
    sums = 1.05 + 0.03 * rng.standard_normal(2_000)
    first = sums - 1 + (2 - sums) * rng.random(2_000)
    distances = np.column_stack([first, sums - first])
    assert distances.min() < 0.06
    assert not is_pressed(distances, TWO, EQUAL)


def test_a_sum_is_pressed_where_both_lengths_are(rng: np.random.Generator) -> None:
    drawn = rng.random((200_000, 2))
    weights = np.exp(-drawn.sum(axis=1) / 0.03)
    assert is_pressed(drawn, TWO, weights / weights.sum())
    few = np.flatnonzero(drawn.sum(axis=1) < 0.2)
    assert not is_pressed(drawn[few], TWO, np.full(len(few), 1 / len(few)))


def test_samples_count_by_their_weights(rng: np.random.Generator) -> None:
    distances = np.vstack([bell(rng, -0.1, 0.05), bell(rng, 0.5, 0.02)])
    for share, pressed in ((1.0, True), (0.0, False)):
        weights = np.concatenate([share * EQUAL, (1 - share) * EQUAL])
        assert is_pressed(distances, ONE, weights) is pressed
