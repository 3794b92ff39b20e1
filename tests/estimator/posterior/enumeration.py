"""A posterior by summing over every set of attachments and a grid of lengths; no sampler in it."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.special import logsumexp

from estimator.body.morphology import Array
from estimator.posterior.likelihood import Likelihood, Noise, SensorData
from estimator.posterior.unknowns import SCALE_SPREAD, Attachments, Predictor

_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(5)


def enumerated(
    predictor: Predictor, data: SensorData, noise: Noise, counts: tuple[int, ...], grid: int
) -> dict[Attachments, float]:
    """Probability of every set of attachments.

    Args:
        predictor: Computes readings.
        data: What the robot felt.
        noise: How far readings stray.
        counts: How many values each choice has.
        grid: Values of each length.
    """
    unknowns = predictor.unknowns
    middles = (np.arange(grid) + 0.5) / grid
    lengths = np.array(list(itertools.product(middles, repeat=unknowns.continuous.size)))
    factors = SCALE_SPREAD * np.array(list(itertools.product(_NODES, repeat=2)))
    weights = np.log(np.outer(_WEIGHTS, _WEIGHTS).ravel() / (2 * np.pi))
    likelihood = Likelihood(data, noise)
    logs: dict[Attachments, float] = {}
    for key in itertools.product(*(range(count) for count in counts)):
        values: Array = np.zeros((len(lengths), unknowns.size))
        values[:, unknowns.choices] = (np.array(key) + 0.5) / np.array(counts)
        values[:, unknowns.continuous] = lengths
        misfits = likelihood.misfits_of(predictor, values)
        width = np.ones(len(values))
        terms = [
            likelihood.of(misfits, width, np.tile(factor, (len(values), 1))).sum(axis=1) + weight
            for factor, weight in zip(factors, weights, strict=True)
        ]
        logs[key] = float(logsumexp(terms))
    total = logsumexp(list(logs.values()))
    return {key: float(np.exp(log - total)) for key, log in logs.items()}


def distance(one: dict[Attachments, float], other: dict[Attachments, float]) -> float:
    """Total variation between two distributions."""
    keys = set(one) | set(other)
    return 0.5 * sum(abs(one.get(key, 0.0) - other.get(key, 0.0)) for key in keys)
