from __future__ import annotations

import numpy as np
import pytest

from estimator.posterior.posterior import coverage, coverage_of_classes, found_by_each


def test_what_two_populations_met_tells_how_much_was_missed() -> None:
    keys, shares = [(0,), (1,), (2,)], np.array([0.5, 0.3, 0.2])
    assert coverage(shares, found_by_each(keys, [{(0,), (1,)}, {(0,), (1,)}])) == 1.0
    assert coverage(shares, found_by_each(keys, [{(0,)}, {(1,)}])) == 0.0
    partly = coverage(shares, found_by_each(keys, [{(0,), (1,)}, {(0,), (2,)}]))
    assert partly == pytest.approx(1 - (1 - 0.5 / 0.7) * (1 - 0.5 / 0.8))


@pytest.mark.parametrize(("part", "known"), [(0.0, 0.0), (0.001, 0.0), (1.0, 1.0)])
def test_a_trifle_that_feels_like_the_first_is_not_the_first_met(part: float, known: float) -> None:
    shares, alike = np.array([0.6, 0.39, 0.01]), np.array([1.0, 1.0, part])
    found = np.array([[True, False], [True, False], [False, True]])
    assert coverage_of_classes(shares, found, alike) == pytest.approx(known, abs=0.01)
