"""Against values from the literature and by hand."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from estimator.reproduction.claims.statistics import (
    different,
    holm,
    mean_and_deviation,
    mean_difference,
    rates_differ,
    share,
    smaller,
)


def test_no_command_waits_for_scipy_that_does_not_use_it() -> None:
    code = "import estimator.cli.command_line, sys; sys.exit('scipy' in sys.modules)"
    root = Path(__file__).parents[4]
    assert subprocess.run([sys.executable, "-c", code], check=False, cwd=root).returncode == 0


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


def test_signed_ranks_of_differences_of_one_sign_are_one_of_all_signs() -> None:
    lower = [-1.0, -2.0, -3.0, -4.0, -5.0]
    assert smaller(lower) == pytest.approx(0.5**5)
    assert smaller([-item for item in lower]) == pytest.approx(1.0)
    assert different(lower) == pytest.approx(2 * 0.5**5)


def test_signed_ranks_on_a_textbook_example() -> None:
    """Darwin's maize, crossed minus self-fertilised, in eighths of an inch; rank sums 96 and 24."""
    differences = [49.0, -67, 8, 16, 6, 23, 28, 41, 14, 29, 56, 24, 75, 60, -48]
    assert different(differences) == pytest.approx(0.0413, abs=5e-5)


def test_equal_pairs_tell_nothing() -> None:
    assert smaller([0.0] * 4) == different([0.0] * 4) == 1.0
    assert smaller([0.0, -1.0, 0.0]) == pytest.approx(0.5)


def test_a_mean_difference_lies_in_its_interval() -> None:
    differences = np.random.default_rng(1).normal(3.0, 1.0, 200)
    difference = mean_difference(differences.tolist())
    half = 1.96 / math.sqrt(200)
    assert difference.mean == pytest.approx(float(np.mean(differences)))
    assert (difference.low, difference.high) == pytest.approx(
        (difference.mean - half, difference.mean + half), abs=0.02
    )
    assert mean_difference(differences.tolist()) == difference


def test_an_interval_of_differences_that_do_not_vary_is_a_point() -> None:
    same = mean_difference([0.5] * 5)
    assert (same.low, same.mean, same.high) == (0.5, 0.5, 0.5)
    one = mean_difference([0.5])
    assert (one.low, one.mean, one.high) == (None, 0.5, None)


def test_fishers_tea() -> None:
    assert rates_differ(share(3, 4), share(1, 4)) == pytest.approx(34 / 70)


def test_mean_and_deviation_of_few() -> None:
    assert mean_and_deviation([1.0, 3.0]) == pytest.approx((2.0, math.sqrt(2)))
    assert mean_and_deviation([1.0]) == (1.0, None)
    assert mean_and_deviation([]) == (None, None)
