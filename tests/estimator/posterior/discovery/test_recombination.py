"""What two searches found apart is put together, leg by leg."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.body.morphology import Array
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.discovery.discovery import Discovery
from estimator.posterior.discovery.neighbours import subtrees, with_subtrees_of_others
from estimator.posterior.discovery.population import Population
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns
from tests.estimator.exploration.test_few_limbs import genome_of
from tests.estimator.posterior.discovery.quadruped import PARTS, PROBLEM, quadruped
from tests.estimator.two_unknown_rows import NOISE, draw

_POSES = 6


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    return Predictor(Unknowns(genome_of(PROBLEM)), StaticsPhysics())


@pytest.fixture(scope="module")
def data(predictor: Predictor) -> SensorData:
    rng = np.random.default_rng(2)
    return draw(
        predictor,
        quadruped(),
        rng.uniform(-0.5, 0.5, (_POSES, PARTS)),
        rng,
        outlier=0.0,
    )


def but_for(unknowns: Unknowns, *legs: int) -> Array:
    """The quadruped with both parts of some legs anywhere."""
    point = quadruped()
    for leg in legs:
        for part in (leg, leg + 4):
            point[unknowns.parts[part]] = np.random.default_rng(part).random(4)
    return point


def test_a_subtree_is_a_part_with_all_that_it_carries(predictor: Predictor) -> None:
    unknowns = predictor.unknowns
    for part, subtree in enumerate(subtrees(quadruped(), unknowns)):
        parts = [part, part + 4] if part < 4 else [part]
        assert np.flatnonzero(subtree).tolist() == sorted(
            np.concatenate([unknowns.parts[one] for one in parts])
        )


def test_legs_that_each_lacks_are_taken_from_the_other(
    predictor: Predictor, data: SensorData
) -> None:
    unknowns = predictor.unknowns
    lengths = GaussNewton(predictor, Likelihood(data, NOISE))
    body, other = but_for(unknowns, 1), but_for(unknowns, 0, 2)
    _, (wanted, *before) = lengths.polished(np.stack([quadruped(), body, other]))
    assert max(before) < wanted - 10
    points, fits = with_subtrees_of_others(body, other[None], unknowns, lengths)
    assert fits.max() > wanted - 1
    assert unknowns.keys(points)[int(np.argmax(fits))] == unknowns.keys(quadruped()[None])[0]
    assert np.array_equal(fits, lengths.fits(points))


def test_a_search_that_began_anew_takes_legs_from_what_was_met_before(
    predictor: Predictor, data: SensorData, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("estimator.posterior.discovery.neighbours.Neighbours.of", _nobody)
    chains, own = np.random.default_rng(5), np.random.default_rng(6)
    population = Population.of_prior(predictor, chains, levels=4, chains_per_level=8)
    search = Discovery(population, predictor, own, explores=False)
    search.starts = but_for(predictor.unknowns, 3)[None]
    search.observe(Likelihood(data, NOISE))
    search.restart(1)
    population.replace_coldest(
        np.repeat(but_for(predictor.unknowns, 0)[None], 8, axis=0), np.zeros((8, 2))
    )
    (wanted,) = predictor.unknowns.keys(quadruped()[None])
    assert wanted not in predictor.unknowns.keys(search.best().values)
    assert wanted in predictor.unknowns.keys(search.search(5).values)


def _nobody(_: object, leader: Array) -> tuple[Array, Array]:
    return np.empty((0, leader.size)), np.empty(0)
