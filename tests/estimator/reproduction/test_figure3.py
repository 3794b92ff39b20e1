import numpy as np
import pytest

from estimator.body.morphology import Base
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.reproduction.figure3 import quality, random_models


def test_measures_by_hand() -> None:
    measures = quality(np.array([[0.2, 0.2, 0.2, 0.3], [0.22] * 4]), np.array([0.22] * 4))
    assert measures["mean_leg_error_m"].tolist() == pytest.approx([0.035, 0.0])
    assert measures["longest_minus_shortest_m"].tolist() == pytest.approx([0.1, 0.0])
    assert measures["variance_m2"].tolist() == pytest.approx([0.001875, 0.0])


def test_random_legs_are_sums_of_two_uniform_parts() -> None:
    from scipy import stats  # takes a second, which other tests need not wait for

    genome = Genome(Problem.load("parametric"), Base(size=(0.14, 0.14, 0.085), mass=1.0))
    measures = random_models(genome, np.array([0.22] * 4))
    leg = stats.triang(c=0.5, loc=0.02, scale=0.38)
    expected = leg.expect(lambda length: abs(length - 0.22))
    assert float(np.mean(measures["mean_leg_error_m"])) == pytest.approx(expected, abs=0.002)
    assert np.all(measures["longest_minus_shortest_m"] <= 0.38)
