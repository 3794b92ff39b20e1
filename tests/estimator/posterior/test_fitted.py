"""What a posterior says of programs and readings, to whoever asks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from estimator import EstimatorError, FittedPosterior, Observation
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from tests.estimator.model_robot import make_capabilities, make_posterior, make_problem

SAMPLES = np.random.default_rng(1).random((30, 4))
PROGRAMS = np.random.default_rng(2).uniform(-0.5, 0.5, (300, 4))  # more than are read at once


@pytest.fixture(scope="module")
def posterior() -> FittedPosterior:
    return make_posterior(make_problem(), make_capabilities(), SAMPLES)


def test_a_prediction_of_many_programs_is_that_of_each(posterior: FittedPosterior) -> None:
    together = posterior.predict(PROGRAMS)
    assert together.tilt.shape == (300, 30, 2)
    assert together.touch.shape == (300, 30, 4)
    assert together.clearance.shape == (300, 30)
    for number in (0, 136, 137, 299):
        alone = posterior.predict(PROGRAMS[number])
        assert np.array_equal(together[number].tilt, alone.tilt)
        assert np.array_equal(together[number].touch, alone.touch)
    assert np.array_equal(
        posterior.margins(PROGRAMS[:2])[1], posterior.margins(PROGRAMS[1].tolist())
    )


def test_what_one_sample_feels_is_most_likely_under_it(posterior: FittedPosterior) -> None:
    predicted = posterior.predict(PROGRAMS[0])
    observed = Observation(
        angles=tuple(PROGRAMS[0].tolist()),
        touch=tuple(predicted.touch[3].tolist()),
        tilt=tuple(predicted.tilt[3].tolist()),
        clearance=float(predicted.clearance[3]),
    )
    logs = posterior.log_likelihood(observed.angles, observed)
    assert logs.shape == (30,)
    assert logs[3] == logs.max()
    data = SensorData.of([observed], posterior.modalities, posterior.clearance_cap)
    likelihood = Likelihood(data, posterior.noise)
    assert np.array_equal(logs, likelihood.normalised(posterior.predictor, SAMPLES)[:, 0])
    elsewhere = posterior.log_likelihood(PROGRAMS[1], observed)
    assert elsewhere[3] < logs[3]


def test_a_reading_that_was_not_taken_says_nothing(posterior: FittedPosterior) -> None:
    nothing = Observation(angles=(0.0,) * 4, touch=(None,) * 4)
    assert posterior.log_likelihood((0.0,) * 4, nothing) == pytest.approx(np.zeros(30), abs=1e-12)


@given(weights=st.lists(st.integers(0, 50), min_size=30, max_size=30).filter(any))
def test_bodies_stand_for_all_as_often_as_they_weigh(weights: list[int]) -> None:
    known = make_posterior(make_problem(), make_capabilities(), SAMPLES)
    shares = np.array(weights) / sum(weights)
    known.posterior.weights[:] = shares
    lengths = [body.parts[0].length for body in known.bodies(10)]
    own = [known.genome.decode(one).parts[0].length for one in SAMPLES]
    assert len(lengths) == 10
    for length, share in zip(own, shares, strict=True):
        assert abs(lengths.count(length) - 10 * share) < 1 + 1e-9


@pytest.mark.parametrize(
    ("programs", "sentence"),
    [
        ((0.1, 0.2), r"shape \(2,\): give one angle, rad, for each of the robot's 4 joints"),
        (np.zeros((2, 3, 4)), r"shape \(2, 3, 4\)"),
        ((0.1, 0.2, float("nan"), 0.0), "not finite"),
        (("left", 0.2, 0.1, 0.0), "motor programs are angles, rad"),
        (0.3, r"shape \(\)"),
    ],
)
def test_what_is_no_program_is_said(
    posterior: FittedPosterior, programs: ArrayLike, sentence: str
) -> None:
    with pytest.raises(EstimatorError, match=sentence):
        posterior.predict(programs)


def test_an_observation_of_another_robot_is_refused(posterior: FittedPosterior) -> None:
    observed = Observation(angles=(0.0,) * 4, touch=(True, False))
    with pytest.raises(EstimatorError, match="has 4 touch sensors, and the observation has 2"):
        posterior.log_likelihood(observed.angles, observed)
    with pytest.raises(EstimatorError, match="one observation has one program, not 2"):
        posterior.log_likelihood(np.zeros((2, 4)), observed)
