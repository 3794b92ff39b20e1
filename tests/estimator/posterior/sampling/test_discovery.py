from __future__ import annotations

import numpy as np
import pytest

from estimator.posterior.model.likelihood import Likelihood, SensorData
from estimator.posterior.model.slopes import Lengths
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.sampling.discovery import Bodies, Discovery, met_by, share_seen
from estimator.posterior.sampling.evidence import EvidenceEstimator
from estimator.posterior.sampling.population import Population
from tests.estimator.two_unknown_rows import NOISE, draw, programs

POINT = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])


@pytest.fixture
def data(predictor: Predictor) -> SensorData:
    return draw(predictor, POINT, programs(4), np.random.default_rng(2))


def test_attachments_met_with_lengths_that_explain_nothing_are_not_met(
    predictor: Predictor, data: SensorData
) -> None:
    likelihood = Likelihood(data, NOISE)
    estimator = EvidenceEstimator(predictor, data, likelihood, draws=1)
    best, fits = Lengths(predictor, data, likelihood).polished(POINT[None])
    elsewhere = best.copy()
    elsewhere[:, predictor.unknowns.continuous] = 0.95
    (key,) = predictor.unknowns.keys(best)
    for values, met in ((best, {key}), (elsewhere, set())):
        bodies = Bodies(values=values, fits=fits)
        assert met_by(bodies, best, estimator, predictor.unknowns) == met


def test_what_two_populations_met_tells_how_much_was_missed() -> None:
    keys, shares = [(0,), (1,), (2,)], np.array([0.5, 0.3, 0.2])
    assert share_seen(keys, shares, [{(0,), (1,)}, {(0,), (1,)}]) == 1.0
    assert share_seen(keys, shares, [{(0,)}, {(1,)}]) == 0.0
    partly = share_seen(keys, shares, [{(0,), (1,)}, {(0,), (2,)}])
    assert partly == pytest.approx(1 - (1 - 0.5 / 0.7) * (1 - 0.5 / 0.8))


def test_who_begins_anew_keeps_what_was_met(predictor: Predictor, data: SensorData) -> None:
    chains, own = np.random.default_rng(1), np.random.default_rng(2)
    population = Population.of_prior(predictor, chains, levels=4, width=8)
    search = Discovery(population, predictor, own, climbs=False)
    search.observe(data, NOISE)
    before = search.search(10)
    places = population.values.copy()
    search.start_anew(5)
    assert not np.array_equal(population.values, places)
    assert np.array_equal(search.best().values, before.values)
    after = search.search(10)
    assert after.fits[0] >= before.fits[0]
    assert set(predictor.unknowns.keys(before.values)) <= set(predictor.unknowns.keys(after.values))
    assert np.array_equal(search.met[0], after.values[0])
    search.observe(data, NOISE)  # once more
    assert set(predictor.unknowns.keys(search.met)) == set(
        predictor.unknowns.keys(search.best().values)
    )
