"""The subjective error, against values worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.errors import EstimatorError
from estimator.identification.paper.objectives import (
    OBJECTIVES,
    LargestError,
    Objective,
    RobustMeanError,
)
from estimator.readings.modalities import check_modalities
from estimator.readings.observation import Observation, PredictedReadings
from tests.estimator.model_robot import make_capabilities

MODALITIES = ("touch", "tilt", "clearance")
SEEN = Observation(angles=(0.0,) * 4, touch=(True, False), tilt=(0.1, 0.0), clearance=0.05)


def readings(count: int = 3) -> PredictedReadings:
    """Models that feel what the robot felt."""
    made = PredictedReadings.empty(count, 2)
    made.valid[:] = True
    made.touch[:, 0] = True
    made.tilt[:, 0] = 0.1
    made.clearance[:] = 0.05
    return made


largest = LargestError().total


def interaction_errors(
    found: PredictedReadings, seen: Observation, modalities: tuple[str, ...] = MODALITIES
) -> Array:
    return LargestError().terms(found, seen, modalities)


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
    terms = objective.terms(made, SEEN, MODALITIES)
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
    terms = robust.terms(wild, SEEN, MODALITIES)
    assert terms[0] <= 3 * np.log1p(20.0)


def test_an_undecided_pose_earns_nothing_by_the_robust_mean() -> None:
    made = readings()
    made.undecided[0] = True
    robust = RobustMeanError(make_capabilities())
    terms = robust.terms(made, SEEN, MODALITIES)
    assert terms[0] == pytest.approx(3 * np.log1p(20.0))


NAN = math.nan


def two_models() -> PredictedReadings:
    """Two models; the second one's simulation cannot be believed."""
    found = PredictedReadings.empty(2, 4)
    found.touch[0] = [True, True, False, False]
    found.tilt[0] = np.radians([3.0, -1.0])
    found.clearance[0] = 0.050
    found.speed[0] = 0.02
    found.valid[0] = True
    return found


def observed(
    touch: tuple[bool | None, ...] = (True, False, False, True),
    tilt: tuple[float | None, float] = (math.radians(5.0), math.radians(1.5)),
    clearance: float | None = 0.042,
) -> Observation:
    return Observation(angles=(0.0,) * 8, touch=touch, tilt=tilt, clearance=clearance)


TOUCH, TILT, CLEARANCE, SPEED = 2.0, 2.0 + 2.5, 10 * 0.008, 0.02


@pytest.mark.parametrize(
    ("modalities", "expected"),
    [
        (("touch", "tilt", "clearance"), TOUCH + TILT + CLEARANCE + SPEED),
        (("tilt", "clearance"), TILT + CLEARANCE + SPEED),
        (("touch", "clearance"), TOUCH + CLEARANCE + SPEED),
        (("touch", "tilt"), TOUCH + TILT + SPEED),
        (("touch",), TOUCH + SPEED),
        (("tilt",), TILT + SPEED),
        (("clearance",), CLEARANCE + SPEED),
    ],
)
def test_the_seven_variants_of_the_paper(modalities: tuple[str, ...], expected: float) -> None:
    assert interaction_errors(two_models(), observed(), modalities)[0] == pytest.approx(expected)


def test_missing_readings_add_nothing() -> None:
    def error(found: Observation) -> float:
        return float(interaction_errors(two_models(), found)[0])

    assert error(observed(touch=(True, None, False, True))) == pytest.approx(
        1 + TILT + CLEARANCE + SPEED
    )
    assert error(observed(tilt=(None, math.radians(1.5)))) == pytest.approx(
        TOUCH + 2.5 + CLEARANCE + SPEED
    )
    assert error(observed(clearance=None)) == pytest.approx(TOUCH + TILT + SPEED)
    nothing = Observation(angles=(0.0,) * 8, touch=(None,) * 4)
    assert error(nothing) == pytest.approx(SPEED)


def test_an_invalid_reading_never_outranks_a_valid_one() -> None:
    assert interaction_errors(two_models(), observed())[1] == math.inf


def test_an_undecided_pose_adds_nothing_to_the_largest_error() -> None:
    found = two_models()
    decided = interaction_errors(found, observed())
    found.undecided[:] = True
    balanced = interaction_errors(found, observed())
    assert balanced.tolist() == [0.0, math.inf]  # an invalid reading stays invalid
    undecided = np.array([[False, False], [True, True]])
    assert largest(np.stack([decided, balanced]), undecided).tolist() == [decided[0], math.inf]


def test_undecided_poses_carry_no_weight_whatever_they_read() -> None:
    errors = np.array([[1.0, 1.0, 7.0], [9.0, 2.0, 8.0], [3.0, 4.0, 9.0]])
    undecided = np.zeros((3, 3), dtype=bool)
    undecided[1, 0] = True
    undecided[:2, 2] = True
    # the third is undecided in most interactions: what is left is no evidence
    assert largest(errors, undecided).tolist() == [3.0, 4.0, math.inf]
    assert largest(errors[:0], undecided[:0]).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("interactions", "undecided", "counts"),
    [(1, 0, True), (1, 1, False), (2, 1, True), (2, 2, False), (9, 1, True), (9, 2, False)],
)
def test_a_body_that_is_undecided_twice_fits_nothing(
    interactions: int, undecided: int, *, counts: bool
) -> None:
    """Or a search would breed bodies that balance in all poses which they cannot explain."""
    errors = np.full((interactions, 1), 3.0)
    balanced = np.arange(interactions)[:, None] < undecided
    assert largest(errors, balanced).tolist() == [3.0 if counts else math.inf]


def test_touch_sensors_must_be_equally_many() -> None:
    with pytest.raises(EstimatorError, match="the robot has 2 touch sensors"):
        interaction_errors(two_models(), observed(touch=(True, False)))
    assert np.isfinite(interaction_errors(two_models(), observed(touch=()), ("tilt",))[0])


def test_modalities_are_checked() -> None:
    assert check_modalities(["clearance", "touch"]) == ("touch", "clearance")
    with pytest.raises(EstimatorError, match="not smell"):
        check_modalities(["tilt", "smell"])
    with pytest.raises(EstimatorError, match="not none"):
        check_modalities([])
