from __future__ import annotations

import numpy as np
import pytest

from estimator.body.morphology import Array
from estimator.posterior.information import SAMPLES, information_gained
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Posterior, systematic
from tests.estimator.two_unknown_rows import NOISE, draw, programs

LEFT = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
BACK = np.array([0.9, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])


def belief(*points: Array, of: int) -> Posterior:
    """Equally many samples of some bodies."""
    values = np.repeat(np.stack(points), of // len(points), axis=0)
    scales, weights = np.zeros((len(values), 2)), np.full(len(values), 1 / len(values))
    return Posterior(values=values, scales=scales, weights=weights, modes=(), adequate_fit=True)


def gained(predictor: Predictor, before: Posterior, after: Posterior) -> float:
    moved = programs(1, seed=3)  # lifts the body
    data = draw(predictor, LEFT, moved, np.random.default_rng(2), outlier=0.0)
    return information_gained(before, after, predictor, data, NOISE)


def test_one_of_two_bodies_that_feel_quite_differently_is_one_bit(predictor: Predictor) -> None:
    found = gained(predictor, belief(LEFT, BACK, of=400), belief(LEFT, of=10))
    assert found == pytest.approx(1.0, abs=0.02)


def test_what_was_known_before_tells_nothing(predictor: Predictor) -> None:
    same = belief(LEFT, of=400)
    assert gained(predictor, same, same) == pytest.approx(0.0, abs=1e-9)


def test_a_body_that_no_sample_came_near_is_as_much_as_can_be_told(predictor: Predictor) -> None:
    found = gained(predictor, belief(BACK, of=400), belief(LEFT, of=10))
    assert found == pytest.approx(np.log2(SAMPLES), abs=0.1)


def test_samples_come_as_often_as_their_weights_say() -> None:
    weights = np.array([0.5, 0.25, 0.125, 0.125])
    assert systematic(weights, 4, 0.5).tolist() == [0, 0, 1, 3]
    counts = [
        np.bincount(systematic(weights, 4, start), minlength=4) for start in np.arange(0, 1, 0.01)
    ]
    assert np.mean(counts, axis=0) / 4 == pytest.approx(weights)
    even = np.full(300, 1 / 300)
    assert np.unique(systematic(even, 200, 0.3)).size == 200
