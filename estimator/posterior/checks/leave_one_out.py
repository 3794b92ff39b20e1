"""Does one interaction rule out lengths that it would not rule out in the simulator?

Where the engines end in different poses, statics of the true body contradicts what was observed,
and other lengths may explain it. Bodies that explain all interactions but one are therefore drawn,
for each interaction in turn, and those that statics contradicts there are simulated in it. What the
simulator confirms belongs to the posterior as well.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.physics.base import Physics
from estimator.posterior.checks.recheck import simulated_fits
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import Likelihood, Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.special import logsumexp, softmax
from estimator.posterior.model.unknowns import Attachments, Predictor
from estimator.posterior.posterior import Posterior, systematic

_DRAWS: Final = 64
_SIMULATED: Final = 12  # of the draws of one interaction
_CONTRADICTED: Final = 6.0  # nats less than the best body has
_FEWEST: Final = 4.0  # effective number of draws that may stand for others
_WIDE: Final = 1.5  # factor on the proposal's spread
_LITTLE: Final = 0.01  # share of the posterior that is not worth adding


def leave_one_out_check(
    posterior: Posterior,
    predictor: Predictor,
    data: SensorData,
    noise: Noise,
    *,
    reference: Physics,
    like: Collection[Attachments],
    rng: np.random.Generator,
) -> Posterior:
    """The posterior with the lengths that only the simulator admits.

    Args:
        posterior: Of bodies that explain the readings by statics.
        predictor: Statics.
        data: The observations.
        noise: Sensor noise.
        reference: The simulator.
        like: The first mode's attachments, and such as no sensor can tell from them: in the places
            of their samples come the added bodies.
        rng: Draws bodies.
    """
    if len(data) < 2 or not predictor.unknowns.continuous.size:
        return posterior
    best = posterior.modes[0].point
    likelihood = Likelihood(data, noise)
    highest = _fits(likelihood, predictor, best[None])[0]
    evidence = highest.sum() - _log_density_at(GaussNewton(predictor, data, likelihood), best)
    added, shares = [], []
    for interaction in range(len(data)):
        rest = data[np.delete(np.arange(len(data)), interaction)]
        draws, log_density = _draws(
            best, GaussNewton(predictor, rest, Likelihood(rest, noise)), predictor, rng
        )
        fits = _fits(likelihood, predictor, draws)
        others = np.delete(fits, interaction, axis=1).sum(axis=1)
        contradicted = fits[:, interaction] < highest[interaction] - _CONTRADICTED
        explains = others > highest.sum() - highest[interaction] - _CONTRADICTED
        rows = np.flatnonzero(contradicted & explains)
        if not rows.size:
            continue
        tried = predictor.unknowns.decode_all(draws[rng.permutation(rows)[:_SIMULATED]])
        observed = simulated_fits(tried, data[interaction : interaction + 1], noise, reference)
        # which of them the simulator confirms is chance: there a trifle decides
        logs = others - log_density - math.log(_DRAWS)
        confirmed = logs[rows] + logsumexp(observed) - math.log(len(observed))
        as_stated = logsumexp((logs + fits[:, interaction])[~contradicted])
        # by the evidence, should the draws not come near the lengths of the posterior
        share = float(softmax(np.array([logsumexp(confirmed), max(as_stated, evidence)]))[0])
        probable = softmax(confirmed)
        if share > _LITTLE and _FEWEST * np.sum(probable**2) < 1.0:
            added.append((draws[rows], probable))
            shares.append(share)
    if not added:
        return posterior
    kept = systematic(posterior.weights, len(posterior.values), float(rng.random()))
    values, keys = posterior.values[kept], predictor.unknowns.keys(posterior.values[kept])
    own = [row for row, key in enumerate(keys) if key in like]
    values[own] = _mixed(values[own], added, np.array(shares), rng)
    return replace(
        posterior,
        values=values,
        scales=posterior.scales[kept],
        weights=np.full(len(values), 1.0 / len(values)),
    )


def _draws(
    best: Array, solver: GaussNewton, predictor: Predictor, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Bodies around the lengths that fit best, and the logarithm of their density."""
    points, _ = solver.polished(best[None])
    columns = predictor.unknowns.continuous
    normal = rng.standard_normal((_DRAWS, columns.size))
    covariance = np.linalg.inv(solver.slopes(points).precision[0])
    draws = np.tile(points[0], (_DRAWS, 1))
    draws[:, columns] += normal @ (_WIDE * np.linalg.cholesky(covariance)).T
    highest = _log_density_at(solver, points[0]) - columns.size * math.log(_WIDE)
    inside = np.all((draws[:, columns] >= 0) & (draws[:, columns] <= 1), axis=1)
    return draws[inside], (highest - 0.5 * np.sum(normal**2, axis=1))[inside]


def _log_density_at(solver: GaussNewton, best: Array) -> float:
    """Of the normal distribution that a posterior resembles, at its middle."""
    precision = solver.slopes(best[None]).precision[0]
    return float(0.5 * np.linalg.slogdet(precision / (2 * math.pi))[1])


def _fits(likelihood: Likelihood, predictor: Predictor, points: Array) -> Array:
    """Log-likelihoods of n points in k interactions, shape (n, k)."""
    return likelihood.of(likelihood.misfits_of(predictor, points))


def _mixed(
    values: Array, added: list[tuple[Array, Array]], shares: Array, rng: np.random.Generator
) -> Array:
    """The samples with the added bodies in the places of some of them, by their shares."""
    odds = shares / np.maximum(1.0 - shares, _LITTLE)
    counts = np.rint(len(values) * odds / (1.0 + odds.sum())).astype(int)
    mixed = values.copy()
    places = np.split(rng.permutation(len(values)), np.cumsum(counts))
    for (bodies, probable), rows in zip(added, places, strict=False):  # the rest stays
        mixed[rows] = bodies[rng.choice(len(bodies), len(rows), p=probable)]
    return mixed
