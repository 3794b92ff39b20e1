"""What the modalities are called, how they compare, and how they are said."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation, PredictedReadings
from protocol.wire import capabilities

NAN = math.nan
NOTHING = Observation(angles=(0.0, 0.0), touch=(None, None))
SEEN = Observation(
    angles=(0.0, 0.0), touch=(True, False), tilt=(math.radians(10.0), None), clearance=0.05
)


def readings() -> PredictedReadings:
    """Two bodies; the second one is doubtful about a bit, and tilts and lifts a trifle more."""
    both = PredictedReadings.empty(2, 2)
    both.touch[:] = [[True, True], [True, False]]
    both.touch_doubtful[1, 1] = True
    both.tilt[:] = np.radians([[12.0, 3.0], [12.4, 3.0]])
    both.clearance[:] = [0.052, 0.0535]
    return both


def test_they_are_those_of_the_wire() -> None:
    assert tuple(MODALITIES) == capabilities.MODALITIES


def test_a_missing_reading_is_nan_among_numbers() -> None:
    numbers = {name: one.observed(SEEN).tolist() for name, one in MODALITIES.items()}
    assert numbers["touch"] == [1.0, 0.0]
    assert numbers["tilt"] == pytest.approx([math.radians(10.0), NAN], nan_ok=True)
    assert numbers["clearance"] == [0.05]


@pytest.mark.parametrize(
    ("name", "error"), [("touch", [1, 0]), ("tilt", [2.0, 2.4]), ("clearance", [0.02, 0.035])]
)
def test_the_papers_terms(name: str, error: list[float]) -> None:
    assert MODALITIES[name].error(readings(), SEEN) == pytest.approx(error)
    assert MODALITIES[name].error(readings(), NOTHING).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("name", "error", "shown", "said"),
    [
        ("touch", [[0, 1], [0, 0]], 50.0, "50%"),
        ("tilt", [[2.0, NAN], [2.4, NAN]], 2.0, "2.0°"),
        ("clearance", [[2.0], [3.5]], 2.0, "2.0 mm"),
    ],
)
def test_prediction_errors(name: str, error: list[list[float]], shown: float, said: str) -> None:
    modality = MODALITIES[name]
    predicted = np.array(modality.predicted(readings()), dtype=float)
    errors = modality.prediction_errors(predicted, SEEN)
    assert errors == pytest.approx(np.array(error), nan_ok=True)
    mean = float(np.nanmean(errors[0]))
    assert modality.shown(mean) == pytest.approx(shown)
    assert modality.say_error(mean) == said
    assert modality.say_error(None) == "–"


@pytest.mark.parametrize("gauges", [(), (True,), (True, False, True)])
def test_gauges_that_the_problem_does_not_describe_are_not_compared(
    gauges: tuple[bool, ...],
) -> None:
    predicted = np.array([[1.0, 0.0], [0.0, 0.0]])
    errors = MODALITIES["touch"].prediction_errors(
        predicted, Observation(angles=(0.0, 0.0), touch=gauges)
    )
    assert errors.shape == predicted.shape
    assert np.isnan(errors).all()


def test_what_a_sensor_can_hardly_tell_is_alike() -> None:
    both = readings()
    one, other = both[:1], both[1:]
    assert all(modality.alike(one, other).all() for modality in MODALITIES.values())
    other.touch_doubtful[:] = False
    other.tilt[0, 1] += math.radians(0.6)
    other.clearance[0] += 0.001
    assert not any(modality.alike(one, other).any() for modality in MODALITIES.values())


def test_a_missing_reading_is_said() -> None:
    observation = Observation(angles=(0.0,), touch=(True, None), tilt=(None, 0.1))
    said = [modality.say(observation) for modality in MODALITIES.values()]
    assert said == ["touch 1?", "tilt ?, 5.7°", "? clear"]
