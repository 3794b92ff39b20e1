"""What either is so or not is searched for where no body explains the readings without it."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

from estimator.body.morphology import Base
from estimator.executors import ThisProcess
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.checks.verdict import Fit
from estimator.posterior.discovery.beginning import Beginning
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Cost, Predictor, Unknowns
from estimator.posterior.sampling import populations, sampler, weighing
from estimator.posterior.sampling.integrals import Hypothesis
from estimator.posterior.sampling.weighing import Weigher
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from tests.estimator.little_effort import little_search
from tests.estimator.two_unknown_rows import (
    NOISE,
    POINT,
    QUICK,
    TWO_UNKNOWN_ROWS,
    draw,
    make_sampler,
    programs,
)

EXCHANGED = "plugs of touch sensors 1 and 2 exchanged"


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    problem = Problem.parse(TWO_UNKNOWN_ROWS, "two rows")
    genome = Genome(problem, Base(size=(0.14, 0.14, 0.085), mass=1.0))
    return Predictor(Unknowns(genome, problem.table), StaticsPhysics())


def felt(predictor: Predictor, count: int) -> Likelihood:
    """Of a robot with two plugs exchanged, in so many interactions."""
    (true,) = predictor.unknowns.points(POINT[None], {EXCHANGED: np.ones(1)})
    return Likelihood(draw(predictor, true, programs(count), np.random.default_rng(2)), NOISE)


def test_the_body_is_found_with_what_is_otherwise(predictor: Predictor) -> None:
    unknowns, likelihood = predictor.unknowns, felt(predictor, 6)
    beginning = Beginning(
        unknowns=unknowns, make_physics=StaticsPhysics, levels=4, chains_per_level=16
    )
    search = partial(beginning.found_with_each, likelihood, 20)
    with little_search():
        points, cost = search(np.random.default_rng(1), ThisProcess())
    deviations = points[:, unknowns.genes_size :]
    assert np.all(np.sort(deviations, axis=1)[:, -2:] == (0.0, 1.0))
    switches = {n for n, row in enumerate(unknowns.table) if row.switch and row.may_deviate}
    assert set(np.argmax(deviations, axis=1).tolist()) == switches
    assert cost.simulations > 1000 * len(switches)
    best = points[np.argmax(GaussNewton(predictor, likelihood).fits(points))]
    assert list(unknowns.amounts(best[None])) == [EXCHANGED]
    assert unknowns.keys(best[None]) == unknowns.keys(unknowns.as_stated(POINT[None]))


def test_of_a_robot_that_is_exactly_as_stated_nothing_is_searched_for(
    predictor: Predictor,
) -> None:
    problem = Problem.parse(TWO_UNKNOWN_ROWS, "two rows")
    exact = Unknowns(Genome(problem, Base(size=(0.14, 0.14, 0.085), mass=1.0)))
    beginning = Beginning(unknowns=exact, make_physics=StaticsPhysics, levels=4, chains_per_level=8)
    points, cost = beginning.found_with_each(
        felt(predictor, 2), 10, np.random.default_rng(1), ThisProcess()
    )
    assert points.shape == (0, exact.size)
    assert cost == Cost(0, 0)


@pytest.mark.parametrize(
    ("excess", "interactions", "searched"), [(1.5, 2, True), (0.0, 2, False), (1.5, 1, False)]
)
def test_it_is_searched_for_where_readings_can_tell_and_are_explained_poorly(
    predictor: Predictor,
    monkeypatch: pytest.MonkeyPatch,
    excess: float,
    interactions: int,
    searched: bool,
) -> None:
    calls: list[Any] = []

    def noted(own: Beginning, likelihood: Likelihood, *_: Any) -> tuple[Any, Cost]:
        calls.append(likelihood)
        return own.unknowns.as_stated(POINT[None])[:0], Cost(0, 0)

    monkeypatch.setattr(Beginning, "found_with_each", noted)
    for module in (populations, sampler):
        monkeypatch.setattr(module, "fit_of", lambda *body: Fit(unexplained=0, excess=excess))
    assert predictor.unknowns.telling == 2
    with little_search():
        make_sampler(predictor, effort=QUICK).learn(felt(predictor, interactions))
    assert bool(calls) == searched


@pytest.mark.parametrize("given", [True, False])
def test_what_was_found_with_it_is_weighed_beside_what_was_found_without(
    predictor: Predictor, given: bool
) -> None:
    unknowns, likelihood = predictor.unknowns, felt(predictor, 4)
    true = unknowns.points(POINT[None], {EXCHANGED: np.ones(1)})
    wrong = unknowns.as_stated(POINT[None])
    wrong[:, unknowns.choices[2]] += 0.5
    rng = np.random.default_rng(1)
    weigher = Weigher(predictor, likelihood, rng, workers=ThisProcess(), particles=60, causes={})
    weigher.weigh(wrong, np.zeros(1))
    if given:
        weigher.weigh_causes(true)
    modes = weigher.summed(16)
    best = modes.points[[np.argmax(modes.shares)]]
    assert (unknowns.keys(best) == unknowns.keys(true)) == given
    named = {unknowns.table[one.row].name: one.probability for one in modes.causes}
    assert (named.get(EXCHANGED, 0.0) > 0.9) == given


def test_what_was_found_both_ways_is_weighed_once(
    predictor: Predictor, monkeypatch: pytest.MonkeyPatch
) -> None:
    unknowns, likelihood = predictor.unknowns, felt(predictor, 4)
    true = unknowns.points(POINT[None], {EXCHANGED: np.ones(1)})
    added: list[Hypothesis] = []
    weights_of = Weigher._of

    def noted(own: Weigher, hypotheses: Any, particles: int, **how: Any) -> Any:
        if particles == weighing._FEWEST:
            added.extend(hypotheses)
        return weights_of(own, hypotheses, particles, **how)

    monkeypatch.setattr(Weigher, "_of", noted)
    rng = np.random.default_rng(1)
    weigher = Weigher(predictor, likelihood, rng, workers=ThisProcess(), particles=60, causes={})
    weigher.weigh(unknowns.as_stated(POINT[None]), np.zeros(1))
    weigher.weigh_causes(np.vstack([true, true]))
    each = [(one.wide, *unknowns.keys(one.point[None])[0]) for one in added]
    (row,) = (n for n, one in enumerate(unknowns.table) if one.name == EXCHANGED)
    assert row in {one.wide for one in added}
    assert len(each) == len(set(each))
