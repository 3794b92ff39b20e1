"""Legs that sit in each other's places are found together, where no single change is better."""

from __future__ import annotations

from itertools import combinations
from typing import Final

import numpy as np
import pytest

from estimator.body.morphology import Array
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.discovery.discovery import Discovery
from estimator.posterior.discovery.moves import other_attachments
from estimator.posterior.discovery.neighbours import Neighbours, joined_parts
from estimator.posterior.discovery.population import Population
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns
from tests.estimator.exploration.test_few_limbs import genome_of
from tests.estimator.posterior.discovery.quadruped import quadruped
from tests.estimator.two_unknown_rows import NOISE, draw

_POSES: Final = 6


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    return Predictor(Unknowns(genome_of("hexapod-12")), StaticsPhysics())


@pytest.fixture(scope="module")
def truth(predictor: Predictor) -> Array:
    unknowns = predictor.unknowns
    point = np.random.default_rng(1).random((1, unknowns.size))
    truth: Array = unknowns.permitted(point)[0]
    return truth


@pytest.fixture(scope="module")
def data(predictor: Predictor, truth: Array) -> SensorData:
    rng = np.random.default_rng(2)
    return draw(predictor, truth, rng.uniform(-0.5, 0.5, (_POSES, 12)), rng, outlier=0.0)


def confused(truth: Array, unknowns: Unknowns) -> Array:
    """The true body with two legs in each other's place, and all of their hinges otherwise."""
    (places,) = unknowns.places
    point = truth.copy()
    point[places[[1, 4], 0]] = truth[places[[4, 1], 0]]
    for leg in (1, 4):
        hinges = [
            column
            for column in joined_parts(unknowns)[leg].columns.tolist()
            if unknowns.counts[column] == 4
        ]
        point[hinges] = (point[hinges] + 0.5) % 1
    return point


def joined(problem: str) -> set[tuple[tuple[int, ...], bool]]:
    """Parts that are put on together, and whether the first stays on its mount."""
    genes = genome_of(problem).genes
    return {
        (tuple(sorted({genes[column].part for column in one.columns.tolist()})), bool(one.kept))
        for one in joined_parts(Unknowns(genome_of(problem)))
    }


def test_parts_are_joined_where_one_sits_on_the_other() -> None:
    pairs = {((leg, leg + 6), False) for leg in range(6)}
    assert joined("hexapod-12") == pairs
    assert joined("hexapod-18") == pairs | {((leg, leg + 6, leg + 12), True) for leg in range(6)}
    assert not joined("parametric")


def test_where_little_of_all_is_unknown_no_parts_are_joined_that_may_sit_on_each_other() -> None:
    assert not joined("topological")
    alone = {((part,), False) for part in range(8)}
    pairs = {((one, other), True) for one, other in combinations(range(8), 2)}
    assert joined("topological-24") == alone | pairs
    genome = genome_of("topological-24")
    for one in joined_parts(Unknowns(genome)):
        for column, value in one.carried:
            point = np.full((1, genome.size), 0.5)
            point[:, column] = value
            carrier, part = sorted({genome.genes[at].part for at in one.columns.tolist()})
            assert genome.bodies(point).parent[0, part] == carrier


def test_a_leg_of_which_all_three_parts_are_put_on_otherwise_is_put_right() -> None:
    predictor = Predictor(Unknowns(genome_of("hexapod-18")), StaticsPhysics())
    unknowns, rng = predictor.unknowns, np.random.default_rng(1)
    truth = unknowns.permitted(rng.random((1, unknowns.size)))[0]
    data = draw(predictor, truth, rng.uniform(-0.5, 0.5, (9, 18)), rng, outlier=0.0)
    lengths = GaussNewton(predictor, Likelihood(data, NOISE))
    leader, (places,) = truth.copy(), unknowns.places
    leg = np.concatenate([unknowns.parts[part] for part in (0, 6, 12)])
    anew = np.setdiff1d(leg, places)
    leader[anew] = (leader[anew] + 0.5) % 1
    _, (wanted, before) = lengths.polished(np.stack([truth, leader]))
    assert before < wanted - 10
    _, fits = Neighbours(unknowns, lengths, rng).of(leader)
    assert fits.max() > wanted - 2


def test_legs_of_two_parts_that_may_sit_anywhere_are_often_put_right() -> None:
    predictor = Predictor(Unknowns(genome_of("topological-24")), StaticsPhysics())
    unknowns, rng = predictor.unknowns, np.random.default_rng(1)
    truth, right = quadruped(), 0
    data = draw(predictor, truth, rng.uniform(-0.5, 0.5, (_POSES, 8)), rng, outlier=0.0)
    lengths = GaussNewton(predictor, Likelihood(data, NOISE))
    for parts in ((0, 4), (1, 5), (2, 6), (3, 7)):
        leader = truth.copy()
        leg = np.concatenate([unknowns.parts[part] for part in parts])
        leader[leg] = rng.random(leg.size)  # elsewhere, on other parts, and otherwise hinged
        _, (wanted, before) = lengths.polished(np.stack([truth, leader]))
        assert before < wanted - 10
        points, fits = Neighbours(unknowns, lengths, rng).of(leader)
        if fits.max() > wanted - 2:
            right += unknowns.keys(points)[int(np.argmax(fits))] == unknowns.keys(truth[None])[0]
    assert right >= 2


def test_two_legs_in_each_others_places_are_put_right(
    predictor: Predictor, truth: Array, data: SensorData
) -> None:
    unknowns, lengths = predictor.unknowns, GaussNewton(predictor, Likelihood(data, NOISE))
    leader, rng = confused(truth, unknowns), np.random.default_rng(3)
    _, wanted = lengths.polished(truth[None])
    rows = np.concatenate(
        [other_attachments(leader, columns, unknowns, rng) for columns in unknowns.parts.values()]
    )
    best = rows[np.argsort(-lengths.rough_fits(rows, np.arange(_POSES)).sum(axis=1))[:60]]
    _, alone = lengths.polished(best)
    assert alone.max() < wanted[0] - 10
    points, fits = Neighbours(unknowns, lengths, rng).of(leader)
    assert not unknowns.forbidden(points).any()
    assert fits.max() > wanted[0] - 2
    assert np.array_equal(fits, lengths.fits(points))


def test_a_search_that_does_not_wander_puts_them_right_too(
    predictor: Predictor, truth: Array, data: SensorData, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("estimator.posterior.discovery.discovery._SWEPT", ())  # to save time
    chains, own = np.random.default_rng(5), np.random.default_rng(6)
    population = Population.of_prior(predictor, chains, levels=4, chains_per_level=8)
    search = Discovery(population, predictor, own, explores=False)
    search.starts = confused(truth, predictor.unknowns)[None]
    search.observe(Likelihood(data, NOISE))
    _, wanted = GaussNewton(predictor, Likelihood(data, NOISE)).polished(truth[None])
    assert search.best().fits[0] < wanted[0] - 10
    assert search.search(1).fits[0] > wanted[0] - 2


@pytest.mark.parametrize("agreed", [True, False])
@pytest.mark.parametrize("explains", [True, False])
def test_only_neighbours_of_what_all_agreed_on_and_explains_all_are_not_tried(
    predictor: Predictor,
    truth: Array,
    monkeypatch: pytest.MonkeyPatch,
    *,
    explains: bool,
    agreed: bool,
) -> None:
    tried: list[Array] = []

    def of(self: Neighbours, leader: Array) -> tuple[Array, Array]:
        tried.append(leader)
        return leader[None], np.zeros(1)

    monkeypatch.setattr(Neighbours, "of", of)
    known, rng = truth, np.random.default_rng(5)
    observed = draw(predictor, truth, rng.uniform(-0.5, 0.5, (_POSES, 12)), rng, outlier=0.0)
    if not explains:
        known = confused(truth, predictor.unknowns)
    population = Population.of_prior(predictor, rng, levels=4, chains_per_level=8)
    search = Discovery(population, predictor, rng, explores=True)
    search.starts = known[None]
    if agreed:
        search.converged = frozenset(predictor.unknowns.keys(search.starts))
    search.observe(Likelihood(observed, NOISE))
    assert search.explains() is explains
    search.search(1)
    assert bool(tried) is not (agreed and explains)


def test_neighbours_are_tried_as_long_as_better_ones_are_found(
    predictor: Predictor, truth: Array, data: SensorData, monkeypatch: pytest.MonkeyPatch
) -> None:
    unknowns, rng = predictor.unknowns, np.random.default_rng(7)
    chain = unknowns.permitted(rng.random((12, unknowns.size)))
    fits: Array = 1000.0 + 10 * np.arange(len(chain), dtype=float)

    def of(self: Neighbours, leader: Array) -> tuple[Array, Array]:
        (at,) = [*np.flatnonzero((chain == leader).all(axis=1)), -1][:1]
        after = slice(at + 1, at + 2)
        return chain[after], fits[after]

    monkeypatch.setattr(Neighbours, "of", of)
    population = Population.of_prior(predictor, rng, levels=4, chains_per_level=8)
    search = Discovery(population, predictor, rng, explores=True)
    search.starts = confused(truth, unknowns)[None]
    search.observe(Likelihood(data, NOISE))
    assert search.search(1).fits[0] == fits[-1]
