"""Samples of many dimensions stray as far as they should, where particles for evidence need not."""

from __future__ import annotations

import numpy as np

from estimator.body.morphology import Array, Base
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.sampling.integrals import Hypothesis, Integrals
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from tests.estimator.two_unknown_rows import NOISE, draw


def test_lengths_of_many_limbs_stray_as_far_as_they_should() -> None:
    """Of 83 dimensions few particles with few moves say that nearly all is known."""
    problem = Problem.load("hexapod-18")
    genome = Genome(problem, Base(size=(0.3, 0.2, 0.08), mass=1.5))
    predictor, rng = (
        Predictor(Unknowns(genome, problem.table), StaticsPhysics()),
        np.random.default_rng(1),
    )
    unknowns = predictor.unknowns
    genes = unknowns.permitted(rng.random((1, unknowns.genes_size)))
    point = unknowns.as_stated(genes)[0]
    programs = np.radians(rng.uniform(-30, 30, (8, len(problem.motors.driven))))
    likelihood = Likelihood(draw(predictor, point, programs, rng), NOISE)
    integrals = Integrals(predictor, likelihood)
    ((one, particles),), _ = integrals.with_cost(([Hypothesis(0, point)], 64, True, 1))
    settled, cost = integrals.settled_with_cost((one, particles.own, 2))
    assert settled.shape == particles.values.shape
    assert cost.simulations > 0

    def inside(values: Array) -> float:
        own, true = values[:, unknowns.continuous], point[unknowns.continuous]
        low, high = np.quantile(own, (0.05, 0.95), axis=0)
        return float(np.mean((low <= true) & (true <= high)))

    assert inside(particles.values) < 0.6
    assert inside(settled) > 0.7
    spread, before = (
        values[:, unknowns.continuous].std(axis=0).mean() for values in (settled, particles.values)
    )
    assert spread > 1.5 * before
