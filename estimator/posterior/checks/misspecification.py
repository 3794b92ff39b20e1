"""Misspecification check: is the robot built as stated, or does a deviation explain more?

What a problem states wrongly can be made up for by lengths or by other attachments: readings stay
explained, and the answer is wrong. So bodies that deviate from the problem are fitted to the
readings too. One that explains them clearly better says that the problem is wrong; one that
explains them as well is an alternative hypothesis, which a movement may test, and has its share of
the probability until then.

Where statics leaves an interaction unexplained, the simulator is asked before a deviation counts:
if bodies of the problem end there as was observed, statics was wrong, not the problem.

Lengths and the size of a deviation are fitted together. A length that makes up for a deviation may
be far from the true one. So fits start also from other lengths of the branch of parts that
deviates: of what hangs together without the main body, since lengths of a whole leg make up for a
servo at its root.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from estimator.body.morphology import BASE, Array
from estimator.physics.base import Physics
from estimator.physics.equivalence import AGREEMENT, agree
from estimator.posterior.checks.simulator import simulated_fits
from estimator.posterior.model.deviations import Alternative, Deviation, log_priors
from estimator.posterior.model.gauss_newton import PRIOR, GaussNewton, best_of_each
from estimator.posterior.model.likelihood import LIKELY, Likelihood, Noise
from estimator.posterior.model.sensor_data import BRANCH, SensorData
from estimator.posterior.model.special import expit, logsumexp
from estimator.posterior.model.unknowns import Cost, Predictor, deviating_points, sizes_of
from estimator.posterior.posterior import Posterior, systematic

_CLEARLY_BETTER: Final = 2.5  # nats, the interaction that speaks most for it left out
_BETTER_BY_FAR: Final = 10.0  # nats, all interactions; one may be an outlier without the deviation
_PRIOR: Final = 1 / 6  # of all deviations together
_NOT_LOOKED_AT: Final = 0.2  # of these; the families of the others are as probable as each other
_OUTLIER_RATE: Final = 0.004  # unexplained interactions of robots as stated: 2 of 615 recorded
_STRANGE_RATE: Final = 0.3  # of robots that deviate in a way that is not looked at
_STARTS: Final = 8  # samples from which fits start
_WORTH_SAYING: Final = 0.005  # m: a smaller change of legs is not reported
_MATTERS: Final = -0.75  # nats gained on average over all families, to ask the simulator
_SIMULATED: Final = 32  # samples
_MORE_LIKELY: Final = 0.5  # than not
_POORLY: Final = 3.0  # nats less than what explains an interaction best


def fit_alternatives(
    posterior: Posterior,
    predictor: Predictor,
    data: SensorData,
    noise: Noise,
    deviations: Sequence[Deviation],
    *,
    reference: Physics,
    workers: Executor,
) -> tuple[Alternative, ...]:
    """Fits a body of each deviation to the readings.

    Args:
        posterior: Of the problem's bodies.
        predictor: Computes their readings.
        data: The observations.
        noise: Sensor noise.
        deviations: Which to look at.
        reference: The simulator, asked about what statics leaves unexplained.
        workers: Fit the bodies.
    """
    if not deviations:
        return ()
    every = max(1, len(posterior.values) // _STARTS)
    best = posterior.modes[0].point
    starts = np.vstack([best, posterior.values[::every][:_STARTS]])
    deviating = predictor.deviating(deviations)
    numbered = deviating_starts(starts[:2], deviations, deviating, data, noise)
    points, fits = fitted_deviations(numbered, predictor, deviations, data, noise, workers=workers)
    log_shares = _log_shares(points, deviating, data, noise)
    # another of the problem's bodies may explain what the most probable one does not, and lengths
    # that a deviation brings to light may suit it as well
    others = [mode.point for mode in posterior.modes[1 : 1 + _STARTS]]
    candidates = np.vstack([starts, *others, points[:_STARTS, :-2]])
    stated, as_stated = fitted(candidates, predictor, data, noise)
    priors = log_priors(deviations).tolist()
    by_chance = _to_which_side(stated, predictor, data, noise)
    alternatives = [
        Alternative(
            deviation=deviations[int(point[-2])].sized(size),
            point=point[:-2],
            gains=_without(gains, by_chance),
            log_share=log_share,
            log_prior=priors[int(point[-2])],
        )
        for point, size, gains, log_share in zip(
            points, sizes_of(points).tolist(), fits - as_stated, log_shares.tolist(), strict=True
        )
    ]
    if clearly_better(alternatives) is not None or _mean_gain(alternatives) > _MATTERS:
        samples = posterior.values[systematic(posterior.weights, _SIMULATED, 0.5)]
        bodies = np.vstack([stated, samples])
        amends = _amends(bodies, predictor, data, noise, reference) - by_chance
        alternatives = [
            replace(alternative, gains=_without(alternative.gains, amends))
            for alternative in alternatives
        ]
    return tuple(sorted(alternatives, key=lambda alternative: -alternative.gain))


def observable_deviations(
    deviations: Sequence[Deviation],
    point: Array,
    predictor: Predictor,
    programs: Array,
    modalities: Sequence[str],
) -> tuple[Deviation, ...]:
    """The deviations that change the readings of a body in some movement.

    A leg that never reaches the ground may be of any thickness, and a hinge that is turned about
    its own axis is the same hinge.

    Args:
        deviations: Which to look at.
        point: The body, shape (size,).
        predictor: Of the problem's bodies.
        programs: Movements, rad, shape (n, motors).
        modalities: Sensors that may tell.
    """
    count = len(deviations)
    if not count:
        return ()
    points = np.repeat(point[None], count, axis=0)
    as_stated = predictor.read_all(points, programs)
    deviating = predictor.deviating(deviations)
    readings = deviating.read_all(deviating_points(points, np.arange(count)), programs)
    alike = agree(as_stated, readings, modalities).reshape(count, len(programs))
    return tuple(
        one for one, share in zip(deviations, alike.mean(axis=1), strict=True) if share < AGREEMENT
    )


def probability_misspecified(
    alternatives: Sequence[Alternative], outliers: Array, noise: Noise
) -> float:
    """Probability that the robot deviates from the problem; the prior is one robot in six.

    Ways that were looked at are held against the best body of the problem by what both explain,
    all others, as servos that fail on the way, by how many interactions the best body does not:
    robots that are built as stated hardly have any.

    Args:
        alternatives: The deviating bodies that were fitted; none: attachments are not sure yet, nor
            is this.
        outliers: Probability of each interaction that it says nothing about the body, shape (k,).
        noise: By which these were computed.
    """
    if not alternatives:
        return 0.0
    share, other = noise.outlier, _NOT_LOOKED_AT
    # densities of what was observed, to a factor, without the share that the mixture gives outliers
    strange, plain = outliers * (1 - share), (1 - outliers) * share

    def log_density(rate: float) -> float:
        return float(np.log(rate * strange + (1 - rate) * plain).sum())

    not_looked_at = log_density(_STRANGE_RATE) - log_density(_OUTLIER_RATE)
    gains = np.logaddexp(
        math.log(1 - other) + _mean_gain(alternatives), math.log(other) + not_looked_at
    )
    return float(expit(np.array(math.log(_PRIOR / (1 - _PRIOR)) + gains)))


def outliers_left(
    outliers: Array,
    posterior: Posterior,
    predictor: Predictor,
    data: SensorData,
    noise: Noise,
    *,
    reference: Physics,
) -> Array:
    """Probability of each interaction that it says nothing about the body, shape (k,).

    Args:
        outliers: Of each interaction by statics, shape (k,).
        posterior: Of the problem's bodies.
        predictor: Computes their readings.
        data: The observations.
        noise: Sensor noise.
        reference: The simulator, asked where an interaction is more likely an outlier than not.
    """
    if not np.any(outliers > _MORE_LIKELY):
        return outliers
    samples = posterior.values[systematic(posterior.weights, _SIMULATED, 0.5)]
    bodies = np.vstack([posterior.modes[0].point, samples])
    left: Array = outliers * np.exp(-_amends(bodies, predictor, data, noise, reference))
    return left


def with_consequence(deviation: Deviation, lengths: Array, stated: Array) -> str:
    """The name of a deviation that is left, and what it would mean for the lengths.

    Args:
        deviation: How a robot may be built otherwise than the problem says.
        lengths: Of its legs then, m, shape (legs,).
        stated: Of the legs of samples without any deviation, m, shape (n, legs).
    """
    low, median, high = np.quantile(stated, (0.05, 0.5, 0.95), axis=0)
    change = np.where((lengths < low) | (lengths > high), lengths - median, 0.0)
    most = float(change[np.argmax(np.abs(change))]) if change.size else 0.0
    if abs(most) < _WORTH_SAYING:
        return deviation.name
    how = "longer" if most > 0 else "shorter"
    return f"{deviation.name} (then legs are up to {1000 * abs(most):.0f} mm {how})"


def clearly_better(alternatives: Sequence[Alternative]) -> Deviation | None:
    """The deviation by which the readings are explained clearly better, if any."""
    best = max(alternatives, key=lambda alternative: alternative.clear_gain, default=None)
    if best is not None and best.clear_gain > _CLEARLY_BETTER:
        return best.deviation
    best = max(alternatives, key=lambda alternative: alternative.gain, default=None)
    return best.deviation if best is not None and best.gain > _BETTER_BY_FAR else None


def _without(gains: Array, excused: Array) -> Array:
    """Gains but for what speaks for no deviation, shape (k,).

    Where a deviation gains nothing the simulator was not asked what its bodies feel.
    """
    left: Array = gains - np.clip(gains, 0.0, np.maximum(excused, 0.0))
    return left


def _to_which_side(point: Array, predictor: Predictor, data: SensorData, noise: Noise) -> Array:
    """What it costs a body, shape (1, size), to have fallen onto another branch than plumb, nats.

    Shape (k,). A deviation that turns a fall the other way explains it for nothing: to which side
    a body falls says little of how it is built.
    """
    (misfits,) = Likelihood(data, noise).misfits_of(predictor, point)
    costs: Array = -np.log(LIKELY[misfits[:, BRANCH].astype(np.intp)])
    return costs


def _mean_gain(alternatives: Sequence[Alternative]) -> float:
    """Log of the mean likelihood ratio of the alternatives to the problem's best body, nats."""
    return float(logsumexp([alternative.log_weight for alternative in alternatives]))


def _amends(
    points: Array, predictor: Predictor, data: SensorData, noise: Noise, reference: Physics
) -> Array:
    """How much better the simulator explains interactions than statics does, nats, shape (k,).

    Args:
        points: The best body, which statics speaks of, and samples, shape (n, size). The simulator
            speaks of all of them, weighted as if the interaction had not been learnt from.
        predictor: Statics.
        data: The observations.
        noise: Sensor noise.
        reference: The simulator.
    """
    likelihood = Likelihood(data, noise)
    fits = likelihood.of(likelihood.misfits_of(predictor, points))
    bodies = predictor.unknowns.decode_all(points)
    amends = np.zeros(len(data))
    for interaction in np.flatnonzero(likelihood.best()[0] - fits[0] > _POORLY).tolist():
        simulated = simulated_fits(bodies, data[interaction : interaction + 1], noise, reference)
        average = logsumexp(simulated - fits[:, interaction]) - logsumexp(-fits[:, interaction])
        amends[interaction] = max(0.0, average - fits[0, interaction])
    return amends


def _log_shares(points: Array, predictor: Predictor, data: SensorData, noise: Noise) -> Array:
    """Logarithms of the shares of the sizes that explain as much as these do, shape (n,)."""
    precision = GaussNewton(predictor, data, Likelihood(data, noise)).slopes(points).precision
    shares: Array = 0.5 * np.log(PRIOR * np.linalg.inv(precision)[:, -1, -1])
    return shares


_LESS, _MORE = 0.9, 1.25  # sizes to start from: weights change what bears the body, step by step
_OWN_LENGTHS: Final = (0.1, 0.3, 0.5, 0.7, 0.9)  # of the branch that deviates, to start from
_MANY_LENGTHS: Final = 32  # points, where it has several
_KEPT: Final = 4  # of the starts with these lengths
_PROMISING: Final = 3  # starts of each deviation, that fit best while the noise is wide,
_FINISHED: Final = 8  # and of the best, fitted once more
_GROUPS: Final = 2  # of deviations, each fitted by one worker
_ROOTED: Final = 40  # steps to a root: far more than needed


def deviating_starts(
    bodies: Array,
    deviations: Sequence[Deviation],
    deviating: Predictor,
    data: SensorData,
    noise: Noise,
) -> Array:
    """Starts for each deviation, shape (n, size).

    Args:
        bodies: Two of the problem's, the best first, shape (2, size); from the first they deviate a
            little less, from the other a little more.
        deviations: m of them.
        deviating: Of their readings.
        data: The observations.
        noise: Sensor noise.
    """
    count = len(deviations)
    from_bodies = deviating_points(
        np.repeat(bodies, count, axis=0),
        np.tile(np.arange(count), 2),
        np.repeat((_LESS, _MORE), count),
    )
    elsewhere = _of_other_lengths(bodies[0], deviations, deviating, data, noise)
    return np.vstack([from_bodies, elsewhere])


def fitted(
    starts: Array, predictor: Predictor, data: SensorData, noise: Noise
) -> tuple[Array, Array]:
    """The point that fits best, shape (1, size), and its log-likelihoods, shape (1, k).

    Args:
        starts: Shape (n, size).
        predictor: Of their readings.
        data: The observations.
        noise: Sensor noise.
    """
    fitting = _Fitting(predictor, data, noise)
    points, fits = fitting.polished(starts, fitting.fits(starts))
    points, _ = fitting.polished(points, fits)
    return points[:1], fitting.by_interaction(points[:1])


def fitted_deviations(
    starts: Array,
    predictor: Predictor,
    deviations: Sequence[Deviation],
    data: SensorData,
    noise: Noise,
    *,
    workers: Executor,
) -> tuple[Array, Array]:
    """Of each deviation the point that fits best, and their log-likelihoods, shape (n, k).

    Args:
        starts: See ``deviating_starts``.
        predictor: Of readings of the problem's bodies; counts what the workers do.
        deviations: By number.
        data: The observations.
        noise: Sensor noise.
        workers: Fit the deviations of one group each.
    """
    groups = [starts[starts[:, -2] % _GROUPS == number] for number in range(_GROUPS)]
    task = partial(_fitted_in_part, predictor, deviations, data, noise)
    pieces = list(workers.map(task, [group for group in groups if len(group)]))
    for _, _, cost in pieces:
        predictor.add_cost(cost)
    points, fits = (np.concatenate(arrays) for arrays in list(zip(*pieces, strict=True))[:2])
    order = np.argsort(-fits, kind="stable")
    fitting = _Fitting(predictor.deviating(deviations), data, noise, each=True)
    best, rest = np.split(points[order], [_FINISHED])
    better, best_fits = fitting.polished(best, fits[order[:_FINISHED]])
    points, fits = (
        np.concatenate([better, rest]),
        np.concatenate([best_fits, fits[order[_FINISHED:]]]),
    )
    points = points[np.argsort(-fits, kind="stable")]
    return points, fitting.by_interaction(points)


class _Fitting:
    """Fits points to readings, all of them or those of each deviation by themselves.

    Args:
        predictor: Of their readings.
        data: The observations.
        noise: Sensor noise.
        each: Whether the points are of deviations, of which their last column but one holds the
            number.
    """

    def __init__(
        self, predictor: Predictor, data: SensorData, noise: Noise, *, each: bool = False
    ) -> None:
        self._predictor = predictor
        self._likelihood = Likelihood(data, noise)
        self._solver = GaussNewton(predictor, data, self._likelihood, noise_known=True)
        self._each = each

    def fits(self, points: Array) -> Array:
        """Log-likelihoods of n points, shape (n,)."""
        return self._solver.fits(points)

    def polished(self, points: Array, fits: Array, most: int | None = None) -> tuple[Array, Array]:
        """Best points so far, best first, with log-likelihoods; see ``GaussNewton.polished``."""
        groups = points[:, -2] if self._each else np.zeros(len(points))
        more, better = self._solver.polished(points, most, groups)
        points, fits = np.vstack([points, more]), np.concatenate([fits, better])
        which = [(value,) for value in points[:, -2].tolist()] if self._each else [()] * len(points)
        order = best_of_each(which, fits)
        return points[order], fits[order]

    def by_interaction(self, points: Array) -> Array:
        """Log-likelihoods of n points in each interaction, shape (n, k)."""
        return self._likelihood.of(self._likelihood.misfits_of(self._predictor, points))


def _fitted_in_part(
    predictor: Predictor,
    deviations: Sequence[Deviation],
    data: SensorData,
    noise: Noise,
    starts: Array,
) -> tuple[Array, Array, Cost]:
    """Of some deviations the points that fit best, their log-likelihoods, and what that cost."""
    before = predictor.cost
    fitting = _Fitting(predictor.deviating(deviations), data, noise, each=True)
    points, fits = fitting.polished(starts, fitting.fits(starts), _PROMISING)
    return points, fits, predictor.cost.since(before)


def _of_other_lengths(
    best: Array,
    deviations: Sequence[Deviation],
    deviating: Predictor,
    data: SensorData,
    noise: Noise,
) -> Array:
    """Starts for each deviation of a part whose branch has unknown lengths, shape (n, size)."""
    (parents,) = deviating.unknowns.bodies(deviating_points(best[None], 0)).parent
    branches = _branches(parents.tolist())
    tried = [np.empty((0, deviating.unknowns.size))]
    for number, deviation in enumerate(deviations):
        columns = [
            column
            for column, gene in enumerate(deviating.unknowns.genes)
            if gene.trait == "length"
            and deviation.part is not None
            and branches[gene.part] == branches[deviation.part]
        ]
        if columns:
            lengths = _spread(len(columns))
            values = np.repeat(best[None], 2 * len(lengths), axis=0)
            values[:, columns] = np.repeat(lengths, 2, axis=0)
            sizes = np.tile((_LESS, _MORE), len(lengths))
            tried.append(deviating_points(values, number, sizes))
    points = np.vstack(tried)
    if not len(points):
        return points
    interactions = np.arange(len(data))
    fits = (
        GaussNewton(deviating, data, Likelihood(data, noise))
        .rough_fits(points, interactions)
        .sum(axis=1)
    )
    ends = np.cumsum([len(some) for some in tried])[:-1]
    kept = [
        some[np.argsort(-own, kind="stable")[:_KEPT]]
        for some, own in zip(tried, np.split(fits, ends), strict=True)
    ]
    return np.vstack(kept)


def _branches(parents: Sequence[int]) -> list[int]:
    """For each part the one by which it hangs on the main body."""
    branches: list[int] = []
    for part, parent in enumerate(parents):
        branches.append(part if parent == BASE else branches[parent])
    return branches


def _spread(lengths: int) -> Array:
    """Points that cover the unit cube of so many lengths, shape (n, lengths).

    Of several by Roberts's additive recurrence, whose step is made of powers of the root of
    x^(lengths + 1) = x + 1.
    """
    if lengths == 1:
        return np.array(_OWN_LENGTHS)[:, None]
    root = 1.5
    for _ in range(_ROOTED):
        root = (1 + root) ** (1 / (lengths + 1))
    steps = root ** -np.arange(1.0, lengths + 1)
    points: Array = (0.5 + np.arange(1, _MANY_LENGTHS + 1)[:, None] * steps) % 1.0
    return points
