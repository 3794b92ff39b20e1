"""Against values from the literature and by hand."""

import math

import pytest

from estimator.reproduction.statistics import (
    different,
    holm,
    mean_and_deviation,
    rates_differ,
    share,
    smaller,
)


def test_wilson_intervals() -> None:
    every = share(30, 30)
    z = 1.959964
    assert every.low == pytest.approx(30 / (30 + z * z))  # Wilson's formula for p = 1
    assert every.high == pytest.approx(1.0)
    papers = share(1, 10)
    assert (papers.low, papers.high) == pytest.approx((0.0179, 0.4042), abs=5e-5)


def test_holm_on_a_textbook_example() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == []


def test_mann_whitney_of_separate_samples_is_one_in_all_orders() -> None:
    low, high = [1.0, 2.0, 3.0, 4.0, 5.0], [6.0, 7.0, 8.0, 9.0, 10.0]
    assert smaller(low, high) == pytest.approx(1 / math.comb(10, 5))
    assert smaller(high, low) == pytest.approx(1.0)
    assert different(low, high) == pytest.approx(2 / math.comb(10, 5))


def test_equal_values_tell_nothing() -> None:
    assert smaller([3.0] * 4, [3.0] * 4) > 0.4
    assert smaller([1.0], [2.0]) == pytest.approx(0.5)


def test_fishers_tea() -> None:
    assert rates_differ(share(3, 4), share(1, 4)) == pytest.approx(34 / 70)


def test_mean_and_deviation_of_few() -> None:
    assert mean_and_deviation([1.0, 3.0]) == pytest.approx((2.0, math.sqrt(2)))
    assert mean_and_deviation([1.0]) == (1.0, None)
    assert mean_and_deviation([]) == (None, None)
