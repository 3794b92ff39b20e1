"""A posterior by summing over every set of attachments and a grid of lengths; no sampler in it."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.special import logsumexp

from estimator.body.morphology import Array
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import Noise, log_prior
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Attachments, Predictor

_COARSE = 4  # values of each length,
_FINE = 16  # and where attachments matter: less than
_MATTERS = 9.0  # nats below the total


def _quadrature() -> tuple[Array, Array]:
    """Nodes and weights of Gauss and Legendre on either piece of the prior of noise factors."""
    pieces = []
    for low, high, count in ((-0.7, 0.0, 5), (0.0, 2.2, 7)):
        nodes, weights = np.polynomial.legendre.leggauss(count)
        middle, half = (low + high) / 2, (high - low) / 2
        pieces.append((middle + half * nodes, half * weights))
    nodes, weights = (np.concatenate(arrays) for arrays in zip(*pieces, strict=True))
    weights *= np.exp(log_prior(nodes))
    return nodes, weights / weights.sum()


NODES, WEIGHTS = _quadrature()
"""Of the prior of one noise factor's logarithm; the weights add up to 1."""


def enumerated(
    predictor: Predictor,
    data: SensorData,
    noise: Noise,
    counts: tuple[int, ...],
) -> dict[Attachments, float]:
    """Probability of every set of attachments.

    Args:
        predictor: Computes readings.
        data: What the robot observed.
        noise: How far readings stray.
        counts: How many values each choice has.
    """
    keys = list(itertools.product(*(range(count) for count in counts)))
    likelihood = Likelihood(data, noise)
    logs = _log_evidences(predictor, likelihood, np.array(keys), counts, _COARSE)
    for row in np.flatnonzero(logs > logsumexp(logs) - _MATTERS):
        one = np.array(keys[row : row + 1])
        logs[row] = _log_evidences(predictor, likelihood, one, counts, _FINE)[0]
    return dict(zip(keys, np.exp(logs - logsumexp(logs)).tolist(), strict=True))


def _log_evidences(
    predictor: Predictor, likelihood: Likelihood, keys: Array, counts: tuple[int, ...], grid: int
) -> Array:
    """Of some sets of attachments, by summing over a grid of lengths and of noise factors."""
    unknowns = predictor.unknowns
    middles = (np.arange(grid) + 0.5) / grid
    lengths = np.array(list(itertools.product(middles, repeat=unknowns.continuous.size)))
    values: Array = np.zeros((len(keys), len(lengths), unknowns.size))
    values[..., unknowns.choices] = ((keys + 0.5) / np.array(counts))[:, None]
    values[..., unknowns.continuous] = lengths
    misfits = likelihood.misfits_of(predictor, values.reshape(-1, unknowns.size))
    shared = np.log(likelihood._sides(predictor, values.reshape(-1, unknowns.size)))
    noise_scale = np.ones(len(misfits))
    logs = np.full((len(keys), len(lengths)), -np.inf)
    for one, share in zip(NODES, WEIGHTS, strict=True):
        for two, part in zip(NODES, WEIGHTS, strict=True):
            factors = np.tile([one, two], (len(misfits), 1))
            inlier, outlier = likelihood.terms(misfits, noise_scale, factors)
            fits = np.logaddexp(inlier - shared, outlier).sum(axis=1).reshape(logs.shape)
            logs = np.logaddexp(logs, fits + np.log(share * part))
    found: Array = logsumexp(logs, axis=1) - np.log(len(lengths))
    return found


def distance(one: dict[Attachments, float], other: dict[Attachments, float]) -> float:
    """Total variation between two distributions."""
    keys = set(one) | set(other)
    return 0.5 * sum(abs(one.get(key, 0.0) - other.get(key, 0.0)) for key in keys)
