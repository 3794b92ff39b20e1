"""Evidences of bodies that fall to another side, though few sides are tried of each."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.body.morphology import Array
from estimator.posterior.model.gauss_newton import Free, GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.sampling import tempering
from estimator.posterior.sampling.tempering import Target, tempered
from tests.estimator.posterior.model.test_forks import all_sides, at_fork, equal_legs
from tests.estimator.two_unknown_rows import CAP, MODALITIES, NOISE

PARTICLES = 1000


@pytest.fixture(scope="module")
def fork() -> tuple[Predictor, Array, Likelihood]:
    """A body that has fallen to another side than statics has it, and a pose that no body has."""
    predictor, point = equal_legs()
    sides, others = all_sides(predictor, point)
    fallen = at_fork(sides, int(others[0]))
    data = SensorData.of([fallen, fallen.model_copy(update={"tilt": (0.9, 0.9)})], MODALITIES, CAP)
    return predictor, point, Likelihood(data, NOISE)


def evidence(fork: tuple[Predictor, Array, Likelihood], seed: int = 1) -> tuple[float, int]:
    """Its evidence, and how many readings that took."""
    predictor, point, likelihood = fork
    solver, before = GaussNewton(predictor, likelihood), predictor.cost.simulations
    peaks, _ = solver.polished(point)
    target = Target(
        peaks=peaks[None],
        free=Free.lengths(predictor.unknowns.continuous, 1),
        precision=solver.slopes(peaks).precision[None],
        by_care=np.zeros((1, predictor.unknowns.continuous.size), dtype=bool),
        predictor=predictor,
        likelihood=likelihood,
        rng=np.random.default_rng(seed),
    )
    (one,) = tempered(target, PARTICLES)
    return one.log_evidence, predictor.cost.simulations - before


@pytest.fixture(scope="module")
def exact(fork: tuple[Predictor, Array, Likelihood]) -> tuple[float, int]:
    """With all sides tried of each body."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tempering._Run._fits_at, "__defaults__", (1,))  # one in one to all sides
        return evidence(fork)


def test_few_sides_tried_give_the_same_evidence_for_less(
    fork: tuple[Predictor, Array, Likelihood], exact: tuple[float, int]
) -> None:
    found, readings = evidence(fork)
    assert found == pytest.approx(exact[0], abs=0.15)
    assert readings < 0.6 * exact[1]
