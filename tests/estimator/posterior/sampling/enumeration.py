"""A posterior by summing over every set of attachments and a grid of lengths; no sampler in it."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.special import logsumexp

from estimator.body.morphology import Array
from estimator.posterior.model.likelihood import Likelihood, Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import SCALE_SPREAD, Attachments, Predictor

_COARSE = 4  # values of each length,
_FINE = 16  # and where attachments matter: less than
_MATTERS = 9.0  # nats below the total
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(9)


def enumerated(
    predictor: Predictor,
    data: SensorData,
    noise: Noise,
    counts: tuple[int, ...],
) -> dict[Attachments, float]:
    """Probability of every set of attachments.

    Args:
        predictor: Computes readings.
        data: What the robot felt.
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
    width = np.ones(len(misfits))
    logs = np.full((len(keys), len(lengths)), -np.inf)
    for one, share in zip(_NODES, _WEIGHTS, strict=True):
        for two, part in zip(_NODES, _WEIGHTS, strict=True):
            factors = np.tile([SCALE_SPREAD * one, SCALE_SPREAD * two], (len(misfits), 1))
            fits = likelihood.of(misfits, width, factors).sum(axis=1).reshape(logs.shape)
            logs = np.logaddexp(logs, fits + np.log(share * part / (2 * np.pi)))
    found: Array = logsumexp(logs, axis=1) - np.log(len(lengths))
    return found


def distance(one: dict[Attachments, float], other: dict[Attachments, float]) -> float:
    """Total variation between two distributions."""
    keys = set(one) | set(other)
    return 0.5 * sum(abs(one.get(key, 0.0) - other.get(key, 0.0)) for key in keys)
