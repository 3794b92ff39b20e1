"""The robot of ``bench.simulation_based_calibration``: it must feel what the likelihood says."""

from __future__ import annotations

import math

import numpy as np

from bench.prior_bodies import on_robot
from bench.simulation_based_calibration import StaticsRobot, evenly
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.noise import Noise
from estimator.posterior.model.unknowns import Predictor, Unknowns

COUNT = 2000
PLAINLY = 5.0  # standard deviations, which noise alone hardly ever reaches
FAR = math.radians(15)


def test_outliers_are_as_frequent_and_as_far_off_as_in_the_likelihood() -> None:
    problem, genome, capabilities = on_robot("topological")
    world, noise = problem.settings(capabilities), Noise.announced(capabilities)
    robot = StaticsRobot(
        predictor=Predictor(Unknowns(genome), StaticsPhysics(world)),
        body=np.full(genome.size, 0.5),
        scales=np.zeros(2),
        noise=noise,
        cap=world.clearance_cap,
        rng=np.random.default_rng(4),
    )
    flat = np.zeros(len(problem.program_range(capabilities)))
    tilts = np.array([robot.perform(flat).tilt for _ in range(COUNT)], dtype=float)
    tilts = np.abs(tilts).max(axis=1)
    outliers = tilts > PLAINLY * noise.tilt
    # Of those beside the pose predicted some are too near to be told from noise.
    assert 0.7 * noise.outlier < outliers.mean() < 1.1 * noise.outlier
    assert 0.3 < np.mean(tilts[outliers] > FAR) < 0.7, "half of them end anywhere"


def test_few_bodies_cover_the_lengths_evenly() -> None:
    points = np.array([evenly(number, 4) for number in range(60)])
    for low in (0.0, 0.9):
        inside = (points >= low) & (points < low + 0.1)
        np.testing.assert_allclose(inside.mean(axis=0), 0.1, atol=0.035)
