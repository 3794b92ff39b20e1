from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import GRAVITY_TILTS, Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation
from tests.estimator.conftest import BODY
from tests.estimator.two_unknown_rows import CAP, MODALITIES, NOISE

MOVED = [
    *((30, 23, -20, 27), (-30, -27, -30, -30), (-30, 16, 3, -4), (-16, 22, -30, 8)),
    *((24, -29, -29, -21), (-7, -16, 7, -27), (-29, 1, -4, 20)),
]
SIDES = [0, 2, 2, 2, 0, 0, 0]  # to which it fell: at three of the forks not as statics has it
FOUR_LEGS = [
    *(0.939, 0.162, 0.446, 0.533, 0.334, 0.352, 0.453, 0.415),
    *(0.023, 0.623, 0.494, 0.612, 0.122, 0.825, 0.41, 0.363),
]


def felt_by_four_legs() -> GaussNewton:
    """Finds the lengths that explain what the body ``FOUR_LEGS`` observed."""
    genome = Genome(Problem.load("topological"), replace(BODY, mass=0.6))
    predictor, rng = Predictor(Unknowns(genome), StaticsPhysics()), np.random.default_rng(3)
    point, moved = np.array([FOUR_LEGS]), np.radians(MOVED)
    observed = predictor.read_all(point, moved, GRAVITY_TILTS[SIDES])
    tilt = observed.tilt + rng.normal(0, NOISE.tilt, observed.tilt.shape)
    clearance = observed.clearance + rng.normal(0, NOISE.clearance, len(moved))
    observations = [
        Observation(
            angles=tuple(moved[row].tolist()),
            touch=tuple(map(bool, observed.touch[row])),
            tilt=(float(tilt[row, 0]), float(tilt[row, 1])),
            clearance=float(clearance[row]),
        )
        for row in range(len(moved))
    ]
    data = SensorData.of(observations, MODALITIES, CAP)
    return GaussNewton(predictor, Likelihood(data, NOISE))


def test_lengths_that_fit_already_are_not_led_astray() -> None:
    """Wide noise knows of no forks, and leads to lengths from which there is no way back."""
    lengths, point = felt_by_four_legs(), np.array([FOUR_LEGS])
    (before,), (after,) = lengths.fits(point), lengths.polished(point)[1]
    assert after >= before


def test_those_that_fit_best_are_kept() -> None:
    lengths, point = felt_by_four_legs(), np.array([FOUR_LEGS])
    others = np.random.default_rng(1).random((6, point.size))
    kept, fits = lengths.polished(np.vstack([others, point]), 2)
    assert np.all(kept[0, :3] == point[0, :3])
    assert fits[0] > fits[1]


def test_those_that_fit_best_are_kept_of_each_group() -> None:
    lengths, point = felt_by_four_legs(), np.array([FOUR_LEGS])
    others = np.random.default_rng(1).random((6, point.size))
    groups = np.array([7, 7, 3, 3, 3, 7])
    several = np.vstack([others[:3], point, others[3:5]])
    kept, fits = lengths.polished(several, 1, groups=groups)
    assert len(kept) == 2
    assert np.all(kept[0, :3] == point[0, :3])
    alone, fit = lengths.polished(several[groups == 7], 1)
    assert np.allclose(kept[1], alone[0], atol=1e-6)
    assert fits[1] == pytest.approx(fit[0], abs=1e-6)
