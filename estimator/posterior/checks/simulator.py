"""Importance weights by the simulator, and the probability that the robot deviates otherwise.

The posterior is sampled with statics. Some of the samples are simulated with a fine time step, and
each gets a weight (``recheck``): its likelihood by the simulator over that by statics, under the
same mixture. The mean weight of a mode's samples is the factor on the mode's probability.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.physics.base import Physics, WorldSettings
from estimator.posterior.model.likelihood import FORKS, Likelihood, apart
from estimator.posterior.model.noise import Noise
from estimator.posterior.model.special import expit, logsumexp, softmax
from estimator.posterior.model.unknowns import Predictor, simulated
from estimator.posterior.posterior import Posterior, systematic

SAMPLES: Final = 16
"""Number of simulated samples, shared out among modes by probability; of a single mode half."""

STEP: Final = 1 / 240  # the fine time step, s

_REST_WINDOW: Final = 0.3  # s: see ``WorldSettings``

_MOST_MODES: Final = 6  # modes that are simulated, at most
_LEAST_SHARE: Final = 0.005  # least probability of a mode that is simulated
_FEWEST_SAMPLES: Final = 3  # least number of samples of a mode


def fine(world: WorldSettings) -> WorldSettings:
    """The world with the fine time step, where bodies are read once they rest, as a robot is."""
    steps = round(world.steps * world.step / STEP)
    return replace(world, step=STEP, steps=steps, rest_window=_REST_WINDOW)


@dataclass(frozen=True, kw_only=True)
class Recheck:
    """A posterior that was reweighted by the simulator.

    Attributes:
        posterior: The reweighted posterior.
        ess: Effective sample size of the simulated samples.
        simulated: Number of samples that were simulated.
    """

    posterior: Posterior
    ess: float
    simulated: int


def recheck(
    posterior: Posterior, predictor: Predictor, likelihood: Likelihood, reference: Physics
) -> Recheck:
    """Reweights a posterior by a simulator.

    Args:
        posterior: The posterior, sampled with statics.
        predictor: Computes readings by statics.
        likelihood: Likelihood of the observations.
        reference: The simulator.
    """
    keys = predictor.unknowns.keys(posterior.values)
    values, scales, owners = [], [], []
    modes = [mode for mode in posterior.modes[:_MOST_MODES] if mode.probability >= _LEAST_SHARE]
    modes = modes or list(posterior.modes[:1])
    # a single mode has nothing to be weighed against
    shared_out = SAMPLES if len(modes) > 1 else SAMPLES // 2
    for index, mode in enumerate(modes):
        rows = np.array([key == mode.attachments for key in keys])
        count = max(_FEWEST_SAMPLES, round(shared_out * mode.probability)) if rows.any() else 0
        chosen = systematic(np.where(rows, posterior.weights, 0.0), count, 0.5)
        values.append(posterior.values[chosen] if count else mode.point[None])
        scales.append(posterior.scales[chosen] if count else np.zeros((1, 2)))
        owners += [index] * max(1, count)
    points, factors, owner = np.concatenate(values), np.concatenate(scales), np.array(owners)
    by_statics = likelihood.of(likelihood.misfits_of(predictor, points), scales=factors)
    by_simulator = np.where(
        _forks(predictor, points, likelihood),
        by_statics,
        _simulated_fits(points, predictor, likelihood, reference, scales=factors),
    )
    fits = by_simulator.sum(axis=1)
    ratios = fits - by_statics.sum(axis=1)
    of_modes = [owner == index for index in range(len(modes))]
    logs = np.log([mode.probability for mode in modes])
    logs += [logsumexp(ratios[rows]) - np.log(np.sum(rows)) for rows in of_modes]
    probabilities = softmax(logs) * sum(mode.probability for mode in modes)
    reweighted = [
        replace(mode, probability=float(probability), point=points[rows][np.argmax(fits[rows])])
        for mode, probability, rows in zip(modes, probabilities, of_modes, strict=True)
    ]
    others = [mode for mode in posterior.modes if mode not in modes]
    gains = {
        mode.attachments: new.probability / mode.probability
        for mode, new in zip(modes, reweighted, strict=True)
    }
    weights = posterior.weights * np.array([gains.get(key, 1.0) for key in keys])
    return Recheck(
        posterior=replace(
            posterior,
            weights=weights / weights.sum(),
            modes=tuple(sorted([*reweighted, *others], key=lambda mode: -mode.probability)),
        ),
        ess=float(1 / np.sum(softmax(ratios) ** 2)),
        simulated=len(points),
    )


# Share of robots that deviate in a way that is not in the table: chosen, not tuned.
_UNLISTED_ROBOTS: Final = 1 / 30
_AS_STATED: Final = 0.3  # share of these that read like robots as stated: 7 of 20 that were tried
_BY_AMOUNT: Final = 0.3  # share of these that read like one with a large amount: 7 of the same 20
# Share of interactions that are unexplained, of robots as stated. Measured: 2 of 615 in 106
# recorded runs (commit dea41247), 0.0033; rounded up.
_UNEXPLAINED_AS_STATED: Final = 0.004
# The same of robots that deviate in a way that is not in the table and show it: chosen, not tuned.
# Eleven of 26 recorded runs of robots with a fault had ended with one or more (the same commit).
_UNEXPLAINED_IF_UNLISTED: Final = 0.3
_TRIED: Final = 32  # samples that are simulated where an interaction is unexplained
_UNEXPLAINED: Final = 0.5  # probability from which an interaction is unexplained
_POOR_FIT: Final = 3.0  # nats below a perfect prediction from which an interaction is simulated


def probability_unlisted(outliers: Array, noise: Noise, *, deviating: float, prior: float) -> float:
    """Probability that the robot deviates in a way that is not in the table, or changed on the way.

    Some such robots leave interactions unexplained, which robots of the table hardly do. Others
    read like robots as stated, or like those with a large deviation of an amount, which are rare,
    too.

    Args:
        outliers: Probability of each interaction that it says nothing about the body, shape (k,).
        noise: Noise by which these were computed.
        deviating: Share of the posterior with a large deviation of an amount.
        prior: The same share before any reading; 0: the table has no such deviation.
    """
    share = noise.outlier
    # densities of what was observed, to a factor, without the share that the mixture gives outliers
    outlier, inlier = outliers * (1 - share), (1 - outliers) * share

    def log_density(rate: float) -> float:
        return float(np.log(rate * outlier + (1 - rate) * inlier).sum())

    log_seen = math.log(1 - _AS_STATED - _BY_AMOUNT)
    log_seen += log_density(_UNEXPLAINED_IF_UNLISTED) - log_density(_UNEXPLAINED_AS_STATED)
    unseen = _AS_STATED * (1 - deviating) / (1 - prior) + _BY_AMOUNT * deviating / (prior or 1.0)
    log_factor = np.logaddexp(log_seen, math.log(unseen))
    return float(expit(np.array(math.log(_UNLISTED_ROBOTS / (1 - _UNLISTED_ROBOTS)) + log_factor)))


def outliers_left(
    outliers: Array,
    posterior: Posterior,
    predictor: Predictor,
    likelihood: Likelihood,
    *,
    reference: Physics,
) -> Array:
    """Probability of each interaction that it says nothing about the body, by the simulator, too.

    Args:
        outliers: The same probability by statics; both have the shape (k,).
        posterior: The posterior over bodies.
        predictor: Computes the bodies' readings.
        likelihood: Likelihood of the observations.
        reference: The simulator, asked about interactions that the best body explains poorly, if
            any is more likely an outlier than not.
    """
    if not np.any(outliers > _UNEXPLAINED):
        return outliers
    samples = posterior.values[systematic(posterior.weights, _TRIED, 0.5)]
    points = np.vstack([posterior.modes[0].point, samples])
    fits = likelihood.of(likelihood.misfits_of(predictor, points))
    amends = np.zeros(len(likelihood))
    for interaction in np.flatnonzero(likelihood.best()[0] - fits[0] > _POOR_FIT).tolist():
        alone = likelihood[interaction : interaction + 1]
        simulated = _simulated_fits(points, predictor, alone, reference)[:, 0]
        average = logsumexp(simulated - fits[:, interaction]) - logsumexp(-fits[:, interaction])
        amends[interaction] = max(0.0, average - fits[0, interaction])
    left: Array = outliers * np.exp(-amends)
    return left


def _simulated_fits(
    points: Array,
    predictor: Predictor,
    likelihood: Likelihood,
    reference: Physics,
    *,
    scales: Array | None = None,
) -> Array:
    """Log-likelihoods of n points in k interactions by the simulator, shape (n, k)."""
    data = likelihood.data
    readings = simulated(reference, predictor.unknowns, points, data.programs)
    misfits = data.misfits(readings, np.tile(np.arange(len(data)), len(points)))
    by_points = misfits.reshape(len(points), len(data), -1)
    return likelihood.of(by_points, scales=scales)


def _forks(predictor: Predictor, points: Array, likelihood: Likelihood) -> Array:
    """Whether a small inclination of gravity changes the branch a body falls to, shape (n, k)."""
    programs = likelihood.data.programs
    plumb = predictor.read_all(points, programs)
    forks = np.zeros(len(plumb), dtype=bool)
    for gravity_tilt in FORKS:
        inclined = predictor.read_all(points, programs, gravity_tilt)
        forks |= apart(plumb, inclined, likelihood.noise)
    return forks.reshape(len(points), len(likelihood))
