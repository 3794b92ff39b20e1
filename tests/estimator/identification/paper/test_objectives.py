from __future__ import annotations

import numpy as np
import pytest

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.exploration.rules import Objective
from estimator.identification.paper.objectives import OBJECTIVES, LargestError, RobustMeanError
from estimator.physics.base import Readings
from estimator.readings.observation import Observation
from tests.estimator.model_robot import make_capabilities

MODALITIES = ("touch", "tilt", "clearance")
SEEN = Observation(angles=(0.0,) * 4, touch=(True, False), tilt=(0.1, 0.0), clearance=0.05)


def readings(count: int = 3) -> Readings:
    """Models that feel what the robot felt."""
    made = Readings.empty(count, 2)
    made.valid[:] = True
    made.touch[:, 0] = True
    made.tilt[:, 0] = 0.1
    made.clearance[:] = 0.05
    return made


class SummedError(LargestError):
    """One that says only what the total is."""

    def total(self, terms: Array, undecided: Flags) -> Array:
        total: Array = terms.sum(axis=0)
        return total


@pytest.fixture(params=[*sorted(OBJECTIVES.own), SummedError])
def objective(request: pytest.FixtureRequest) -> Objective:
    if request.param is SummedError:
        return SummedError(make_capabilities())
    return OBJECTIVES.load(request.param)(make_capabilities())


def test_a_perfect_model_has_no_error_and_an_invalid_one_an_infinite_one(
    objective: Objective,
) -> None:
    made = readings()
    made.valid[1] = False
    made.tilt[2, 1] = 0.2
    terms = objective.terms(made, SEEN.as_arrays(), MODALITIES)
    assert terms[0] == 0
    assert terms[1] == np.inf
    assert 0 < terms[2] < np.inf


def test_the_bound_holds_whatever_is_still_to_come(objective: Objective) -> None:
    terms = np.random.default_rng(1).uniform(0, 5, (6, 40))
    decided = np.zeros(terms.shape, dtype=bool)
    total = objective.total(terms, decided)
    for known in range(7):
        partly = np.where(np.arange(6)[:, None] < known, terms, 0.0)
        assert np.all(objective.lower_bound(partly) <= total + 1e-12)
    assert objective.lower_bound(terms) == pytest.approx(total)


def test_one_pose_cannot_veto_a_model_by_the_robust_mean() -> None:
    forked = np.full((9, 2), 0.3)
    forked[4, 0] = 60.0  # lands elsewhere once, and fits otherwise
    forked[:, 1] = 5.0  # fits badly everywhere
    decided = np.zeros(forked.shape, dtype=bool)
    largest = LargestError().total(forked, decided)
    assert largest[0] > largest[1]
    robust = RobustMeanError(make_capabilities())
    wild = readings(2)
    wild.tilt[0] = 1.4, -1.4
    terms = robust.terms(wild, SEEN.as_arrays(), MODALITIES)
    assert terms[0] <= 3 * np.log1p(20.0)


def test_an_undecided_pose_earns_nothing_by_the_robust_mean() -> None:
    made = readings()
    made.undecided[0] = True
    robust = RobustMeanError(make_capabilities())
    terms = robust.terms(made, SEEN.as_arrays(), MODALITIES)
    assert terms[0] == pytest.approx(3 * np.log1p(20.0))
