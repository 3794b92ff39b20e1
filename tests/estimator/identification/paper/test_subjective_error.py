"""The subjective error, against values worked out by hand."""

import math

import numpy as np
import pytest

from estimator.errors import EstimatorError
from estimator.identification.paper.subjective_error import interaction_errors, largest
from estimator.readings.modalities import check_modalities
from estimator.readings.observation import Observation, PredictedReadings

NAN = math.nan


def readings() -> PredictedReadings:
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
    assert interaction_errors(readings(), observed(), modalities)[0] == pytest.approx(expected)


def test_missing_readings_add_nothing() -> None:
    def error(found: Observation) -> float:
        return float(interaction_errors(readings(), found)[0])

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
    assert interaction_errors(readings(), observed())[1] == math.inf


def test_an_undecided_pose_adds_nothing_to_the_largest_error() -> None:
    found = readings()
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
        interaction_errors(readings(), observed(touch=(True, False)))
    assert np.isfinite(interaction_errors(readings(), observed(touch=()), ("tilt",))[0])


def test_modalities_are_checked() -> None:
    assert check_modalities(["clearance", "touch"]) == ("touch", "clearance")
    with pytest.raises(EstimatorError, match="not smell"):
        check_modalities(["tilt", "smell"])
    with pytest.raises(EstimatorError, match="not none"):
        check_modalities([])
