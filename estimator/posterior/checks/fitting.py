"""Fits bodies that deviate from a problem to readings: lengths, and how far they deviate, together.

A length that makes up for a deviation may be far from the true one. So fits start also from other
lengths of the branch that deviates: of what hangs together without the main body, since lengths of
a whole leg make up for a servo at its root.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from functools import partial
from typing import Final

import numpy as np

from estimator.body.morphology import BASE, Array
from estimator.posterior.model.deviations import Deviation
from estimator.posterior.model.gauss_newton import GaussNewton, best_of_each
from estimator.posterior.model.likelihood import Likelihood, Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Cost, Predictor, deviating_points

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
