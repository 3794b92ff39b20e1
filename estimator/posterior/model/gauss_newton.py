"""Derivatives of readings by a body's lengths, the lengths that fit best, approximate evidences.

A resting pose is a smooth function of the lengths between one set of contacts and the next, so a
few Gauss-Newton steps find the best lengths of a set of attachments. Interactions count by how
surely they are no outliers, under noise that narrows from step to step. At the best lengths the
derivatives give Laplace's approximation of the evidence.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import step_weight
from estimator.posterior.model.sensor_data import BRANCH, STANCE
from estimator.posterior.model.unknowns import Attachments, Columns, Predictor, Unknowns

ROUGH: Final = 4.0
"""Factor on the noise under which bodies are compared whose lengths are not right yet."""

_WIDE: Final = (ROUGH, 2.0)  # factors on the noise, a step each
_NARROW: Final = (1.0, 1.0, 1.0)

PRIOR: Final = 12.0
"""Precision of the uniform distribution on 0 to 1."""

_LENGTH_STEP: Final = 5e-4  # step of differences, of a length's range
_PARAMETER_STEP: Final = 0.02  # the same, of a parameter's standard deviation
_JUMP: Final = 0.03  # rad or m: a reading that changes more in one such step has jumped
_FARTHEST: Final = 0.25  # largest change in one Gauss-Newton step, of a length's range
_FARTHEST_PARAMETER: Final = 1.0  # the same, of a parameter's standard deviation
_MOST: Final = 4.0  # largest deviation of a parameter, standard deviations
_SHORTER: Final = 0.3  # share of a step that is tried where the whole one does not help


@dataclass(frozen=True, kw_only=True)
class Slopes:
    """Misfits of n points, and what information their readings hold about what is fitted.

    Attributes:
        misfits: Misfits of the points in k interactions, shape (n, k, MISFITS).
        precision: Precision of what is fitted, in units of ``Free.spreads``, shape (n, d, d): the
            curvature of the log-likelihood, the prior's included.
        climb: Gradient of the log-likelihood, the prior's included, shape (n, d).
    """

    misfits: Array
    precision: Array
    climb: Array


@dataclass(frozen=True, kw_only=True)
class Free:
    """What is fitted of n points: lengths, and parameters that have a normal prior.

    Attributes:
        columns: Columns of each point that are fitted, shape (n, d).
        spreads: Range of a length, which is 1, or standard deviation of a parameter, shape (n, d).
        normal: Which of the columns are parameters, shape (d,).
    """

    columns: Columns
    spreads: Array
    normal: Flags

    @classmethod
    def lengths(cls, columns: Columns, count: int) -> Free:
        """Lengths alone, of ``count`` points."""
        shape = (count, columns.size)
        return cls(
            columns=np.broadcast_to(columns, shape),
            spreads=np.ones(shape),
            normal=np.zeros(columns.size, dtype=bool),
        )

    @classmethod
    def with_parameters(cls, unknowns: Unknowns, spreads: Sequence[Mapping[int, float]]) -> Free:
        """Lengths, and parameters by their rows of the table, equally many of each point.

        Args:
            unknowns: Cube whose columns are fitted.
            spreads: Standard deviations of the parameters by row, for each point.
        """
        lengths = unknowns.continuous
        rows = np.array([list(by_row) for by_row in spreads], dtype=np.intp)
        deviations = np.array([list(by_row.values()) for by_row in spreads], dtype=float)
        free_lengths = cls.lengths(lengths, len(spreads))
        columns = np.hstack([free_lengths.columns, unknowns.genes_size + rows])
        return cls(
            columns=columns,
            spreads=np.hstack([free_lengths.spreads, deviations]),
            normal=np.arange(columns.shape[1]) >= lengths.size,
        )

    def __getitem__(self, rows: Columns) -> Free:
        """What is fitted of some of the points."""
        return Free(columns=self.columns[rows], spreads=self.spreads[rows], normal=self.normal)

    def of(self, values: Array) -> Array:
        """Values of the fitted columns, in units of the spreads, shape (n, d)."""
        return np.take_along_axis(values, self.columns, axis=1) / self.spreads

    def within(self, values: Array, own: Array) -> Array:
        """The points with these values of the fitted columns (see ``of``), as far as possible."""
        low, high = np.where(self.normal, -_MOST, 0.0), np.where(self.normal, _MOST, 1.0)
        moved = values.copy()
        np.put_along_axis(moved, self.columns, np.clip(own, low, high) * self.spreads, axis=1)
        return moved

    def log_prior(self, values: Array) -> Array:
        """Logarithm of the parameters' prior density relative to its peak, shape (n,)."""
        density: Array = -0.5 * np.sum(self.of(values)[:, self.normal] ** 2, axis=1)
        return density


class GaussNewton:
    """Finds the lengths that fit best, what else is fitted with them, and approximate evidences.

    Args:
        predictor: Computes readings.
        likelihood: Likelihood of the observations.

    Attributes:
        predictor: As above, like ``likelihood``.
    """

    def __init__(self, predictor: Predictor, likelihood: Likelihood) -> None:
        self.predictor, self.likelihood = predictor, likelihood

    def fits(self, values: Array) -> Array:
        """Log-likelihood of n points, shape (n, size), unknown noise factors integrated out."""
        return self.likelihood.integrated(self.likelihood.misfits_of(self.predictor, values))

    def rough_fits(self, values: Array, interactions: Columns | None = None) -> Array:
        """Log-likelihoods of n points in k of the interactions, by default all, shape (n, k).

        The noise is ``ROUGH`` times the announced one, and all bodies fall as statics has it.
        """
        bodies = self.predictor.unknowns.bodies(values)
        misfits = self.likelihood.misfits_of_bodies(
            self.predictor, bodies, interactions, branches=0
        )
        which = None if interactions is None else interactions[None]
        return self.likelihood.of(misfits, ROUGH, interactions=which)

    def _free_or_lengths(self, values: Array, free: Free | None) -> Free:
        return free or Free.lengths(self.predictor.unknowns.continuous, len(values))

    def polished(
        self,
        values: Array,
        most: int | None = None,
        free: Free | None = None,
        groups: Columns | None = None,
    ) -> tuple[Array, Array]:
        """Points that fit better, and their log-likelihoods, with the prior of parameters.

        Each is optimised twice, from the result under wide noise and from where it was: wide noise
        may lead away from a point that fits already.

        Args:
            values: Points to begin with, shape (n, size).
            most: Largest number of points of each group: those that fit best while the noise is
                wide, best first; by default all points, in their order.
            free: What is fitted; lengths by default.
            groups: Group of each point, shape (n,); by default all are in one.
        """
        led, free = values, self._free_or_lengths(values, free)
        for noise_scale in _WIDE:
            led, fits = self._narrower(led, free, noise_scale)
        kept = np.arange(len(fits))
        if most is not None:
            kept = best_of_each(np.zeros_like(kept) if groups is None else groups, fits, most)
        candidates, free = np.concatenate([led[kept], values[kept]]), free[np.tile(kept, 2)]
        going_on = np.arange(len(candidates))  # what one step does not improve, the next will not
        for noise_scale in _NARROW:
            before = candidates[going_on]
            after, _ = self._narrower(before, free[going_on], noise_scale)
            candidates[going_on] = after
            going_on = going_on[np.any(after != before, axis=1)]
            if not going_on.size:
                break
        fits = self.fits(candidates) + free.log_prior(candidates)
        points, fits = candidates.reshape(2, len(kept), -1), fits.reshape(2, -1)
        better = np.argmax(fits, axis=0), np.arange(len(kept))
        return points[better], fits[better]

    def _narrower(self, values: Array, free: Free, noise_scale: float) -> tuple[Array, Array]:
        """Points after one step, where it is an improvement, and their fits under that noise."""
        values = values.copy()
        slopes = self.slopes(values, noise_scale, free)
        step = np.linalg.solve(slopes.precision, slopes.climb[..., None])[..., 0]
        farthest = np.where(free.normal, _FARTHEST_PARAMETER, _FARTHEST)
        size = np.max(np.abs(step) / farthest, axis=1, keepdims=True, initial=0.0)
        step *= np.minimum(1.0, 1.0 / np.maximum(size, 1e-12))
        best = self.likelihood.of(slopes.misfits, noise_scale).sum(axis=1) + free.log_prior(values)
        branches = slopes.misfits[..., BRANCH]
        rows = np.arange(len(values))
        for share in (1.0, _SHORTER):
            fitted = free[rows]
            trial = fitted.within(values[rows], fitted.of(values[rows]) + share * step[rows])
            misfits = self.likelihood.misfits_of(
                self.predictor, trial, branches=branches[rows], coarse_step=noise_scale > 1
            )
            fits = self.likelihood.of(misfits, noise_scale).sum(axis=1) + fitted.log_prior(trial)
            better = fits > best[rows]
            values[rows[better]], best[rows[better]] = trial[better], fits[better]
            rows = rows[~better]
            if not rows.size:
                break
        return values, best

    def slopes(self, values: Array, noise_scale: float = 1.0, free: Free | None = None) -> Slopes:
        """Precision and gradient of the log-likelihood of points, shape (n, size), by differences.

        Under wider noise than announced forks are left out, and joints turn in coarse steps, which
        are precise enough there.
        """
        free = self._free_or_lengths(values, free)
        count, (_, size) = len(values), free.columns.shape
        wide = noise_scale > 1
        misfits = self.likelihood.misfits_of(self.predictor, values, branches=0 if wide else None)
        fitted, step = free.of(values), np.where(free.normal, _PARAMETER_STEP, _LENGTH_STEP)
        step = np.where(fitted + step > np.where(free.normal, np.inf, 1.0), -step, step)
        moved = np.repeat(values, size, axis=0)
        cells = np.arange(len(moved)), free.columns.ravel()
        moved[cells] += (step * free.spreads).ravel()
        moved_misfits = self.likelihood.misfits_of(
            self.predictor,
            moved,
            branches=np.repeat(misfits[..., BRANCH], size, axis=0),
            coarse_step=wide,
            stances=np.repeat(misfits[..., STANCE], size, axis=0),
        )
        residuals = self.likelihood.data.residuals(misfits)
        moved_residuals = self.likelihood.data.residuals(moved_misfits).reshape(
            count, size, len(self.likelihood), -1
        )
        change = moved_residuals - residuals[:, None]
        weight = self.likelihood.inlier_share(misfits, noise_scale)[..., None]
        sigmas = noise_scale * self.likelihood.sigmas
        weight = weight * step_weight(residuals / sigmas) / sigmas**2
        weight = np.where(np.max(np.abs(change), axis=1, initial=0.0) > _JUMP, 0.0, weight)
        change /= step[:, :, None, None]
        precision = np.einsum("nikc,nkc,njkc->nij", change, weight, change, optimize=True)
        climb = -np.einsum("nikc,nkc,nkc->ni", change, weight, residuals, optimize=True)
        climb -= np.where(free.normal, fitted, 0.0)
        prior = np.diag(np.where(free.normal, 1.0, PRIOR))
        return Slopes(misfits=misfits, precision=precision + prior, climb=climb)

    def half_volumes(self, values: Array, free: Free | None = None) -> Array:
        """What Laplace's approximation of the evidence adds to the fits of n points, shape (n,)."""
        free = self._free_or_lengths(values, free)
        lengths = np.count_nonzero(~free.normal)
        log_precision = np.linalg.slogdet(self.slopes(values, free=free).precision)[1]
        volumes: Array = 0.5 * (lengths * math.log(2 * math.pi) - log_precision)
        return np.minimum(0.0, volumes)

    def evidences(self, values: Array, free: Free | None = None) -> Array:
        """Laplace's approximation of the log-evidences of n points' attachments, shape (n,).

        They decide which sets of attachments are weighed (``weighing``).

        Args:
            values: The best point of each set, shape (n, size).
            free: What the likelihood is integrated over; lengths by default.
        """
        fits = self.fits(values) + (free.log_prior(values) if free else 0.0)
        log_prior = self.predictor.unknowns.log_prior(values)
        evidences: Array = fits + self.half_volumes(values, free) + log_prior
        return evidences

    def evidences_as_built(self, values: Array) -> tuple[Array, Array]:
        """The best points with narrow components open, shape (n, size), and their evidences."""
        table = self.predictor.unknowns.table
        narrow = {row: parameter.narrow for row, parameter in enumerate(table) if parameter.narrow}
        free = Free.with_parameters(self.predictor.unknowns, [narrow] * len(values))
        points, _ = self.polished(values, free=free)
        return points, self.evidences(points, free)


def best_of_each(keys: Sequence[Attachments] | Columns, fits: Array, most: int = 1) -> Columns:
    """Indices of the ``most`` points that fit best among those of equal keys, best first."""
    counted: dict[Attachments | int, int] = {}
    kept = []
    for row in np.argsort(-fits, kind="stable").tolist():
        key = keys[row]
        count = counted.get(key, 0)
        if count < most:
            counted[key] = count + 1
            kept.append(row)
    return np.array(kept, dtype=np.intp)
