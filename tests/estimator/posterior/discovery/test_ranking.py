"""Many points ranked, most of them by a few interactions only."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.body.morphology import Array
from estimator.posterior.discovery.neighbours import ranked
from estimator.posterior.model.gauss_newton import GaussNewton, best_of_each
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor
from tests.estimator.two_unknown_rows import NOISE, POINT, draw, programs


def fits_of(points: Array, lengths: GaussNewton) -> Array:
    each: Array = lengths.rough_fits(points, np.arange(len(lengths.likelihood))).sum(axis=1)
    return each


def lengths_with(predictor: Predictor, interactions: int) -> GaussNewton:
    data: SensorData = draw(predictor, POINT, programs(interactions), np.random.default_rng(2))
    return GaussNewton(predictor, Likelihood(data, NOISE))


@pytest.mark.parametrize(("count", "interactions"), [(1500, 2), (150, 8)])
def test_few_interactions_or_points_are_ranked_by_all(
    predictor: Predictor, count: int, interactions: int
) -> None:
    rng, lengths = np.random.default_rng(3), lengths_with(predictor, interactions)
    points = rng.random((count, POINT.size))
    best_first = ranked(points, lengths, predictor.unknowns, rng)
    truly = points[best_of_each(predictor.unknowns.keys(points), fits_of(points, lengths))]
    assert len(best_first) >= 100
    assert np.array_equal(best_first, truly[: len(best_first)])


def test_what_fits_best_is_hardly_ever_lost_with_most_of_the_work_skipped(
    predictor: Predictor,
) -> None:
    rng, lengths = np.random.default_rng(3), lengths_with(predictor, 8)
    points = rng.random((3000, POINT.size))
    before = predictor.cost.simulations
    best_first = ranked(points, lengths, predictor.unknowns, rng)
    assert predictor.cost.simulations - before < 0.5 * len(points) * 8
    keys = predictor.unknowns.keys(points)
    truly = points[best_of_each(keys, fits_of(points, lengths))[:20]]
    assert np.array_equal(best_first[0], truly[0])
    assert sum(any(np.array_equal(one, other) for other in best_first[:40]) for one in truly) >= 15


def test_of_each_set_of_attachments_the_best_is_kept(predictor: Predictor) -> None:
    rng, lengths = np.random.default_rng(3), lengths_with(predictor, 4)
    points = rng.random((1000, POINT.size))
    best_first = ranked(points, lengths, predictor.unknowns, rng)
    keys = predictor.unknowns.keys(best_first)
    assert len(set(keys)) == len(keys) > 20
    assert np.array_equal(best_first[0], points[np.argmax(fits_of(points, lengths))])
