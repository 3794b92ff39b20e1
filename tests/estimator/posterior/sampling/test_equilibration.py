"""Samples of many dimensions stray as far as they should, where particles for evidence need not."""

from __future__ import annotations

import numpy as np

from estimator.body.morphology import Base
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.sampling.integrals import Hypothesis, Integrals
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from tests.estimator.two_unknown_rows import NOISE, draw


def test_lengths_of_many_limbs_stray_as_far_as_they_should() -> None:
    """Of 84 dimensions few particles with few moves say that nearly all is known."""
    problem, size = Problem.load("hexapod-18"), (0.3, 0.2, 0.08)
    base = Base(size=size, mass=1.5, mounts=problem.tables.base_mounts(size))
    predictor = Predictor(Unknowns(Genome(problem, base), problem.table), StaticsPhysics())
    unknowns, inside = predictor.unknowns, []
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        genes = unknowns.permitted(rng.random((1, unknowns.genes_size)))
        point = unknowns.as_stated(genes)[0]
        programs = np.radians(rng.uniform(-30, 30, (8, len(problem.motors.driven))))
        likelihood = Likelihood(draw(predictor, point, programs, rng), NOISE)
        integrals = Integrals(predictor, likelihood)
        ((one, particles),), _ = integrals.with_cost(([Hypothesis(point)], 32, True, 1))
        equilibrated, cost = integrals.equilibrated_with_cost((one, particles.own, 2))
        assert equilibrated.shape == particles.values.shape
        assert cost.simulations > 0
        true = point[unknowns.continuous]
        ends = (
            np.quantile(values[:, unknowns.continuous], (0.05, 0.95), axis=0)
            for values in (particles.values, equilibrated)
        )
        inside.append([np.mean((low <= true) & (true <= high)) for low, high in ends])
    before, after = np.mean(inside, axis=0)
    assert before < 0.6
    assert after > 0.8
