"""The simulator has the last word: samples are reweighted, and admitted, by what it predicts.

Statics finds the posterior. A simulation of some of its samples with a fine time step gives each a
weight (``recheck``): its likelihood there over its likelihood in statics, under the same mixture.

Where the engines end in different poses, statics of the true body contradicts what was observed,
and other lengths may explain it. For each interaction in turn (``leave_one_out_check``) bodies that
explain all others are therefore drawn, and those that statics contradicts there are simulated in
it. What the simulator confirms belongs to the posterior as well.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.physics.base import Physics, WorldSettings
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import FORKS, Likelihood, Noise, apart
from estimator.posterior.model.special import expit, logsumexp, softmax
from estimator.posterior.model.unknowns import Attachments, Predictor
from estimator.posterior.posterior import Posterior, systematic

SAMPLES: Final = 16
"""Samples simulated, shared out among the modes by their probability."""

STEP: Final = 1 / 240  # s

_REST_WINDOW: Final = 0.3  # s

_RIVALS: Final = 6  # modes that are simulated, at most
_WORTH: Final = 0.005  # probability of a mode that is simulated
_FEWEST: Final = 3  # samples of a mode


def fine(world: WorldSettings) -> WorldSettings:
    """The world with the fine time step, in which bodies are read when a robot would be."""
    steps = round(world.steps * world.step / STEP)
    return replace(world, step=STEP, steps=steps, rest_window=_REST_WINDOW)


@dataclass(frozen=True, kw_only=True)
class Recheck:
    """A posterior that was reweighted by the simulator.

    Attributes:
        posterior: The posterior with its weights.
        ess: Effective sample size of the simulated samples.
        simulated: How many samples were simulated.
    """

    posterior: Posterior
    ess: float
    simulated: int


def recheck(
    posterior: Posterior,
    predictor: Predictor,
    likelihood: Likelihood,
    reference: Physics,
) -> Recheck:
    """Reweights a posterior by a simulator.

    Args:
        posterior: Found with statics.
        predictor: Statics.
        likelihood: Of the observations.
        reference: The simulator.
    """
    keys = predictor.unknowns.keys(posterior.values)
    values, scales, owners = [], [], []
    modes = [mode for mode in posterior.modes[:_RIVALS] if mode.probability >= _WORTH]
    modes = modes or list(posterior.modes[:1])
    for index, mode in enumerate(modes):
        rows = [row for row, key in enumerate(keys) if key == mode.attachments]
        count = max(_FEWEST, round(SAMPLES * mode.probability))
        chosen = rows[:: max(1, len(rows) // count)][:count]
        values.append(posterior.values[chosen] if chosen else mode.point[None])
        scales.append(posterior.scales[chosen] if chosen else np.zeros((1, 2)))
        owners += [index] * max(1, len(chosen))
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
    logs += [logsumexp(ratios[own]) - np.log(np.sum(own)) for own in of_modes]
    probabilities = softmax(logs) * sum(mode.probability for mode in modes)
    better = [
        replace(mode, probability=float(probability), point=points[own][np.argmax(fits[own])])
        for mode, probability, own in zip(modes, probabilities, of_modes, strict=True)
    ]
    others = [mode for mode in posterior.modes if mode not in modes]
    gains = {
        mode.attachments: new.probability / mode.probability
        for mode, new in zip(modes, better, strict=True)
    }
    weights = posterior.weights * np.array([gains.get(key, 1.0) for key in keys])
    return Recheck(
        posterior=replace(
            posterior,
            weights=weights / weights.sum(),
            modes=tuple(sorted([*better, *others], key=lambda mode: -mode.probability)),
        ),
        ess=float(1 / np.sum(softmax(ratios) ** 2)),
        simulated=len(points),
    )


_OTHERWISE: Final = 1 / 30  # of robots are otherwise in a way that nobody looks for
_TAKEN_IN: Final = 0.3  # of these feel all like another robot: 5 of 17 odd ones that were tried
_OUTLIER_RATE: Final = 0.004  # unexplained interactions of robots as stated: 2 of 615 recorded
_STRANGE_RATE: Final = 0.3  # of robots that are otherwise and show it
_TRIED: Final = 32  # samples
_MORE_LIKELY: Final = 0.5  # than not
_POORLY: Final = 3.0  # nats less than what explains an interaction best


def probability_unlisted(outliers: Array, noise: Noise) -> float:
    """Probability that the robot is otherwise as nobody looks for, or changed on the way.

    It shows by interactions that nothing explains, of which robots that are as stated hardly have
    any; or not at all: what a servo that is too weak lifts is what another robot would lift. So no
    probability that is stated comes closer to 1 than a hundredth.

    Args:
        outliers: Probability of each interaction that it says nothing about the body, shape (k,).
        noise: By which these were computed.
    """
    share = noise.outlier
    # densities of what was observed, to a factor, without the share that the mixture gives outliers
    strange, plain = outliers * (1 - share), (1 - outliers) * share

    def log_density(rate: float) -> float:
        return float(np.log(rate * strange + (1 - rate) * plain).sum())

    gained = np.logaddexp(
        math.log1p(-_TAKEN_IN) + log_density(_STRANGE_RATE),
        math.log(_TAKEN_IN) + log_density(_OUTLIER_RATE),
    ) - log_density(_OUTLIER_RATE)
    return float(expit(np.array(math.log(_OTHERWISE / (1 - _OTHERWISE)) + gained)))


def outliers_left(
    outliers: Array,
    posterior: Posterior,
    predictor: Predictor,
    likelihood: Likelihood,
    *,
    reference: Physics,
) -> Array:
    """Probability of each interaction that it says nothing about the body, shape (k,).

    Args:
        outliers: Of each interaction by statics, shape (k,).
        posterior: Of the bodies that explain the readings.
        predictor: Computes their readings.
        likelihood: Of the observations.
        reference: The simulator, asked where an interaction is more likely an outlier than not.
    """
    if not np.any(outliers > _MORE_LIKELY):
        return outliers
    samples = posterior.values[systematic(posterior.weights, _TRIED, 0.5)]
    points = np.vstack([posterior.modes[0].point, samples])
    fits = _fits(likelihood, predictor, points)
    amends = np.zeros(len(likelihood))
    for interaction in np.flatnonzero(likelihood.best()[0] - fits[0] > _POORLY).tolist():
        one = likelihood[interaction : interaction + 1]
        simulated = _simulated_fits(points, predictor, one, reference)[:, 0]
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
    readings = predictor.simulated(reference, points, data.programs)
    misfits = data.misfits(readings, np.tile(np.arange(len(data)), len(points)))
    by_points = misfits.reshape(len(points), len(data), -1)
    return likelihood.of(by_points, scales=scales)


def _forks(predictor: Predictor, points: Array, likelihood: Likelihood) -> Array:
    """Where a small inclination of gravity changes the branch a body falls to, shape (n, k)."""
    programs = likelihood.data.programs
    plumb = predictor.read_all(points, programs)
    forks = np.zeros(len(plumb), dtype=bool)
    for lean in FORKS:
        forks |= apart(plumb, predictor.read_all(points, programs, lean), likelihood.noise)
    return forks.reshape(len(points), len(likelihood))


_DRAWS: Final = 64  # bodies for each interaction that is left out
_SIMULATED: Final = 12  # of the draws of one interaction
_CONTRADICTED: Final = 6.0  # nats less than the best body has
_FEWEST_DRAWS: Final = 4.0  # effective number of draws that may stand for others
_WIDE: Final = 1.5  # factor on the proposal's spread
_LITTLE: Final = 0.01  # share of the posterior that is not worth adding


def leave_one_out_check(
    posterior: Posterior,
    predictor: Predictor,
    likelihood: Likelihood,
    *,
    reference: Physics,
    like: Collection[Attachments],
    rng: np.random.Generator,
) -> Posterior:
    """The posterior with the lengths that only the simulator admits.

    Args:
        posterior: Of bodies that explain the readings by statics.
        predictor: Statics.
        likelihood: Of the observations.
        reference: The simulator.
        like: The first mode's attachments, and such as no sensor can tell from them: in the places
            of their samples come the added bodies.
        rng: Draws bodies.
    """
    if len(likelihood) < 2 or not predictor.unknowns.continuous.size:
        return posterior
    best = posterior.modes[0].point
    highest = _fits(likelihood, predictor, best[None])[0]
    evidence = highest.sum() - _log_density_at(GaussNewton(predictor, likelihood), best)
    added, shares = [], []
    for interaction in range(len(likelihood)):
        rest = likelihood[np.delete(np.arange(len(likelihood)), interaction)]
        draws, log_density = _draws(best, GaussNewton(predictor, rest), predictor, rng)
        fits = _fits(likelihood, predictor, draws)
        others = np.delete(fits, interaction, axis=1).sum(axis=1)
        contradicted = fits[:, interaction] < highest[interaction] - _CONTRADICTED
        explains = others > highest.sum() - highest[interaction] - _CONTRADICTED
        rows = np.flatnonzero(contradicted & explains)
        if not rows.size:
            continue
        tried = draws[rng.permutation(rows)[:_SIMULATED]]
        one = likelihood[interaction : interaction + 1]
        observed = _simulated_fits(tried, predictor, one, reference)[:, 0]
        # which of them the simulator confirms is chance: there a trifle decides
        logs = others - log_density - math.log(_DRAWS)
        confirmed = logs[rows] + logsumexp(observed) - math.log(len(observed))
        as_stated = logsumexp((logs + fits[:, interaction])[~contradicted])
        # by the evidence, should the draws not come near the lengths of the posterior
        share = float(softmax(np.array([logsumexp(confirmed), max(as_stated, evidence)]))[0])
        probable = softmax(confirmed)
        if share > _LITTLE and _FEWEST_DRAWS * np.sum(probable**2) < 1.0:
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
