from __future__ import annotations

import numpy as np
import pytest

from estimator.body.morphology import Array, Base
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.discovery import discovery
from estimator.posterior.discovery.discovery import Discovery
from estimator.posterior.discovery.population import Population
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from tests.estimator.two_unknown_rows import NOISE, POINT, draw, programs


@pytest.fixture
def moved(monkeypatch: pytest.MonkeyPatch) -> list[Population]:
    """The populations that were moved, each as often as that happened."""
    moved: list[Population] = []
    step = Population.step

    def counted(population: Population) -> None:
        moved.append(population)
        step(population)

    monkeypatch.setattr(Population, "step", counted)
    return moved


@pytest.fixture
def data(predictor: Predictor) -> SensorData:
    return draw(predictor, POINT, programs(4), np.random.default_rng(2))


def test_who_begins_anew_keeps_what_was_met(predictor: Predictor, data: SensorData) -> None:
    chains, own = np.random.default_rng(1), np.random.default_rng(2)
    population = Population.of_prior(predictor, chains, levels=4, chains_per_level=8)
    search = Discovery(population, predictor, own, explores=False)
    search.observe(Likelihood(data, NOISE))
    before = search.search(10)
    places = population.values.copy()
    search.restart(5)
    assert not np.array_equal(population.values, places)
    assert np.array_equal(search.best().values, before.values)
    after = search.search(10)
    assert after.fits[0] >= before.fits[0]
    assert set(predictor.unknowns.keys(before.values)) <= set(predictor.unknowns.keys(after.values))
    assert np.array_equal(search.starts[0], after.values[0])
    search.observe(Likelihood(data, NOISE))  # once more
    assert set(predictor.unknowns.keys(search.starts)) == set(
        predictor.unknowns.keys(search.best().values)
    )


def test_a_search_for_much_begins_with_lengths_to_which_any_of_its_best_starts_leads(
    predictor: Predictor, data: SensorData
) -> None:
    rng = np.random.default_rng(1)
    population = Population.of_prior(predictor, rng, levels=4, chains_per_level=8)
    search = Discovery(population, predictor, rng, explores=True)
    lengths = predictor.unknowns.continuous
    search.starts = np.repeat(POINT[None], 20, axis=0)
    search.starts[:, lengths] = rng.random((20, lengths.size))
    search.observe(Likelihood(data, NOISE))
    solver = GaussNewton(predictor, Likelihood(data, NOISE))
    _, led = solver.polished(search.starts)
    assert led.min() < led.max() - 10  # not all do
    assert search.best().fits[0] == led.max()


@pytest.mark.parametrize("agreed", [True, False])
def test_what_all_searches_agreed_on_is_only_watched_while_it_explains_all(
    predictor: Predictor, moved: list[Population], monkeypatch: pytest.MonkeyPatch, *, agreed: bool
) -> None:
    tried: list[Array] = []

    def other_attachments(leader: Array, *args: object) -> Array:
        tried.append(leader)
        return leader[None]

    monkeypatch.setattr(discovery, "other_attachments", other_attachments)
    monkeypatch.setattr(discovery, "_FEW_STEPS", 2)
    data = draw(predictor, POINT, programs(4), np.random.default_rng(2), outlier=0.0)
    rng = np.random.default_rng(1)
    population = Population.of_prior(predictor, rng, levels=4, chains_per_level=8)
    search = Discovery(population, predictor, rng, explores=False)
    search.starts = POINT[None]
    if agreed:
        search.converged = frozenset(predictor.unknowns.keys(search.starts))
    search.observe(Likelihood(data, NOISE))
    search.search(8)
    assert search.explains()
    assert bool(tried) is not agreed
    assert len(moved) == (2 if agreed else 8)


def test_lengths_alone_are_found_with_few_steps_of_the_chains(moved: list[Population]) -> None:
    genome = Genome(Problem.load("parametric"), Base(size=(0.14, 0.14, 0.085), mass=1.0))
    predictor, rng = Predictor(Unknowns(genome), StaticsPhysics()), np.random.default_rng(1)
    true = rng.random(predictor.unknowns.size)
    likelihood = Likelihood(draw(predictor, true, programs(6), rng, outlier=0.0), NOISE)
    population = Population.of_prior(predictor, rng, levels=4, chains_per_level=8)
    search = Discovery(population, predictor, rng, explores=False)
    search.observe(likelihood)
    search.search(40)
    assert len(moved) == 10
    _, (known,) = GaussNewton(predictor, likelihood).polished(true[None])
    assert search.best().fits[0] > known - 0.5
