from __future__ import annotations

import numpy as np
import pytest

from estimator.posterior.posterior import coverage, coverage_of_classes, found_by_each


def test_what_two_populations_met_tells_how_much_was_missed() -> None:
    keys, shares = [(0,), (1,), (2,)], np.array([0.5, 0.3, 0.2])
    assert coverage(shares, found_by_each(keys, [set(keys), set(keys)])) == pytest.approx(1.0)
    assert coverage(shares, found_by_each(keys, [{(0,)}, {(1,)}])) == 0.0
    partly = coverage(shares, found_by_each(keys, [{(0,), (1,)}, {(0,), (2,)}]))
    assert partly == pytest.approx(1 - (1 - 0.5 / 0.715) * (1 - 0.5 / 0.81))


def test_a_trifle_that_both_met_does_not_vouch_for_what_one_alone_has_found() -> None:
    """Of a hexapod 0.994 was stated of a wrong body: the other population had found 0.5 %."""
    found = np.array([[True, False], [True, True]])
    assert coverage(np.array([0.995, 0.005]), found) < 0.1
    assert coverage(np.array([0.7, 0.3]), found) == pytest.approx(0.9, abs=0.05)
    assert coverage(np.array([0.05, 0.95]), found) > 0.99


@pytest.mark.parametrize(("part", "known"), [(0.0, 0.0), (0.001, 0.0), (1.0, 1.0)])
def test_a_trifle_that_feels_like_the_first_is_not_the_first_met(part: float, known: float) -> None:
    shares, alike = np.array([0.6, 0.39, 0.01]), np.array([1.0, 1.0, part])
    found = np.array([[True, False], [True, False], [False, True]])
    assert coverage_of_classes(shares, found, alike) == pytest.approx(known, abs=0.01)
