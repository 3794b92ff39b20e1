"""The evidence of sets of attachments, and particles, by tempered sequential Monte Carlo.

What is integrated over, for each set of attachments by itself, are its lengths, uniform beforehand,
and θ, what else may be otherwise than stated, standard normal beforehand. A reading changes with
these smoothly between one set of contacts and the next only, and of masses only changes of contacts
tell, so that no single peak stands for the integral. Particles start from a distribution that is
known, and go to the posterior by powers from 0 to 1 of the ratio of both, each so much larger that
the particles' weights keep a share of their effective size::

    q0 = N(θ; 0, 1) (0.9 N(lengths; best, 4 C + 0.02²) + 0.1)
    target(power) = q0 (likelihood N(θ; 0, 1) / q0) ** power

Between two powers they are moved, each half by what the other half knows: along differences of two
others (differential evolution); θ by preconditioned Crank-Nicolson steps in random subsets of it,
lengths following as they depend on θ; lengths alone. Several sets of attachments are computed side
by side, each with powers of its own. Noise factors are integrated on a grid.

Where no best point fell to another side of a fork, bodies fall on the way as statics has it with
coarse steps; from the posterior by that, particles go on to the one by the likelihood proper, with
its forks, in the same manner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.posterior.model.gauss_newton import Free
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import BRANCH
from estimator.posterior.model.special import logsumexp
from estimator.posterior.model.unknowns import Columns, Predictor

_KEPT: Final = 0.6  # effective share of particles after each step towards the posterior
_NEAR: Final = 0.9  # share of the start that lies around the best lengths
_WIDER: Final = 4.0  # times their covariance,
_AT_LEAST: Final = 0.02  # and this standard deviation, of a length's range, added
_MOVES: Final = 5  # after each step
_LAST: Final = 12  # more in the end
_JITTER: Final = 1e-3
_FREEDOM: Final = 4.0  # of the lengths' own steps, Student's t
_BISECTIONS: Final = 30
_NOWHERE: Final = -1e9  # log-likelihood where there is no body
_MOST_STEPS: Final = 60  # towards the posterior


class Particles(NamedTuple):
    """What stands for the posterior of one set of attachments.

    Attributes:
        log_evidence: Logarithm of the integral of the likelihood over lengths, θ and noise factors.
        values: Equally likely points, shape (particles, size).
        fits: Their log-likelihoods, noise factors integrated out, shape (particles,).
        ess: How many were different when they were drawn by their weights for the last time.
    """

    log_evidence: float
    values: Array
    fits: Array
    ess: float


@dataclass(frozen=True, kw_only=True)
class _Start:
    """The distribution of lengths at power 0 for g sets of attachments: means (g, d), and so on."""

    mean: Array
    root: Array
    inverse: Array
    log_peak: Array

    @classmethod
    def around(cls, best: Array, covariance: Array) -> _Start:
        size = best.shape[1]
        wide = _WIDER * covariance + _AT_LEAST**2 * np.eye(size)
        root: Array = np.asarray(np.linalg.cholesky(wide))
        log_root = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
        return cls(
            mean=best,
            root=root,
            inverse=np.asarray(np.linalg.inv(root)),
            log_peak=-0.5 * size * math.log(2 * math.pi) - log_root,
        )

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        groups, size = self.mean.shape
        normal = rng.standard_normal((groups, count, size))
        near = self.mean[:, None] + normal @ np.swapaxes(self.root, 1, 2)
        anywhere = rng.random((groups, count, size))
        return np.where(rng.random((groups, count, 1)) < _NEAR, near, anywhere)

    def log_density(self, lengths: Array, groups: Columns) -> Array:
        """Of points of the groups, shape (g, n, d) in; −inf outside the range."""
        away = lengths - self.mean[groups, None]
        distance = np.sum((away @ np.swapaxes(self.inverse[groups], 1, 2)) ** 2, axis=2)
        near = math.log(_NEAR) + self.log_peak[groups, None] - 0.5 * distance
        density: Array = np.logaddexp(near, math.log(1 - _NEAR))
        return density


def tempered(
    points: Array,
    free: Free,
    covariances: Array,
    *,
    predictor: Predictor,
    likelihood: Likelihood,
    rng: np.random.Generator,
    particles: int,
) -> list[Particles]:
    """Evidence and particles of several sets of attachments.

    Args:
        points: The best of each, shape (g, size).
        free: What is integrated over, lengths before parameters.
        covariances: Of their lengths there, shape (g, d, d).
        predictor: Computes readings.
        likelihood: Of the observations.
        rng: Draws the particles.
        particles: For each; even.
    """
    start = _Start.around(free.of(points)[:, ~free.normal], covariances)
    return _Run(
        points,
        free,
        start,
        predictor=predictor,
        likelihood=likelihood,
        rng=rng,
        count=particles,
    ).finished()


class _Run:
    def __init__(
        self,
        points: Array,
        free: Free,
        start: _Start,
        *,
        predictor: Predictor,
        likelihood: Likelihood,
        rng: np.random.Generator,
        count: int,
    ) -> None:
        self._predictor, self._likelihood, self._rng = predictor, likelihood, rng
        self._points, self._free, self._count = points, free, count
        self._lengths = int(np.count_nonzero(~free.normal))
        self._start = start
        self._ess = np.full(len(points), float(count))
        groups = len(points)
        normal = rng.standard_normal((groups, count, np.count_nonzero(free.normal)))
        self._x = np.concatenate([self._start.draw(count, rng), normal], axis=2)
        branches = likelihood.misfits_of(predictor, points)[..., BRANCH]
        self._forked = bool(np.any(branches != 0))
        self._proper = False  # whether that is where particles go to
        self._goal, self._base = self._evaluated(self._x, np.arange(groups))
        self._powers, self._log_evidence = np.zeros(groups), np.zeros(groups)

    def finished(self) -> list[Particles]:
        """Goes to the posterior."""
        everyone = np.arange(len(self._points))
        self._drawn_anew(everyone, np.where(self._goal > _NOWHERE, 0.0, _NOWHERE))
        self._go()
        if not self._forked:
            self._proper = True
            self._powers[:] = 0.0
            self._goal, self._base = self._evaluated(self._x, everyone)
            self._go()
        for _ in range(_LAST):
            self._move(everyone)
        return [self._particles(group) for group in range(len(self._points))]

    def _go(self) -> None:
        """From one density to the other, all groups."""
        for _ in range(_MOST_STEPS):
            going = np.flatnonzero(self._powers < 1)
            if not going.size:
                return
            self._go_on(going)
            for _ in range(_MOVES):
                self._move(going)

    def _particles(self, group: int) -> Particles:
        return Particles(
            log_evidence=float(self._log_evidence[group]),
            values=self._values(np.full(self._count, group), self._x[group]),
            fits=self._goal[group].copy(),
            ess=float(self._ess[group]),
        )

    def _evaluated(self, x: Array, groups: Columns) -> tuple[Array, Array]:
        """Logarithms of the densities that particles go to and come from, shape (g, n)."""
        lengths = x[..., : self._lengths]
        inside = np.all((lengths >= 0) & (lengths <= 1), axis=2)
        which, _ = np.nonzero(inside)
        values = self._values(groups[which], x[inside])
        rough = np.full(inside.shape, _NOWHERE)
        rough[inside] = self._fits_of(values, surely=not self._forked)
        if not self._proper:
            return rough, self._start.log_density(lengths, groups)
        proper = np.full(inside.shape, _NOWHERE)
        proper[inside] = self._fits_of(values, surely=False)
        return proper, rough

    def _values(self, groups: Columns, x: Array) -> Array:
        """Points of n groups, shape (n,), with what is integrated over, shape (n, d)."""
        values = self._points[groups].copy()
        own = x * self._free.spreads[groups]
        np.put_along_axis(values, self._free.columns[groups], own, axis=1)
        return values

    def _fits_of(self, values: Array, *, surely: bool) -> Array:
        likelihood, predictor = self._likelihood, self._predictor
        return likelihood.integrated(likelihood.misfits_of(predictor, values, surely=surely))

    def _go_on(self, going: Columns) -> None:
        """Takes the next power of each group, by which the particles are drawn anew."""
        ratios = self._goal[going] - self._base[going]
        low, high = self._powers[going].copy(), np.ones(going.size)
        here = low.copy()
        whole = _share(ratios, high - here) >= _KEPT
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            enough = _share(ratios, middle - here) >= _KEPT
            low, high = np.where(enough, middle, low), np.where(enough, high, middle)
        powers = np.where(whole, 1.0, low)
        self._powers[going] = powers
        self._drawn_anew(going, (powers - here)[:, None] * ratios)

    def _drawn_anew(self, groups: Columns, logs: Array) -> None:
        """Draws the particles of some groups by the logarithms of their weights."""
        self._log_evidence[groups] += logsumexp(logs, axis=1) - math.log(self._count)
        weights = np.exp(logs - logs.max(axis=1, keepdims=True))
        ends = np.cumsum(weights, axis=1)
        starts = (np.arange(self._count) + self._rng.random((groups.size, 1))) / self._count
        for group, row_ends, row_starts in zip(groups.tolist(), ends, starts, strict=True):
            rows = np.searchsorted(row_ends, row_starts * row_ends[-1], side="right")
            rows = self._rng.permutation(np.minimum(rows, self._count - 1))
            self._ess[group] = np.unique(rows).size
            self._x[group] = self._x[group, rows]
            self._goal[group] = self._goal[group, rows]
            self._base[group] = self._base[group, rows]

    def _move(self, groups: Columns) -> None:
        """Moves both halves, each by what the other knows."""
        half = self._count // 2
        for own, other in (
            (slice(None, half), slice(half, None)),
            (slice(half, None), slice(None, half)),
        ):
            x, others = self._x[groups, own], self._x[groups, other]
            slopes, roots = _regression(others, self._lengths)
            kinds = 3 if self._lengths < x.shape[2] else 2
            kind = self._rng.integers(kinds, size=x.shape[:2])
            proposed = np.choose(
                kind[..., None],
                [
                    self._along_differences(x, others),
                    self._lengths_alone(x, roots),
                    self._crank_nicolson(x, slopes),
                ],
            )
            self._accept(groups, own, x, proposed, kind == 2)

    def _accept(
        self, groups: Columns, own: slice, x: Array, proposed: Array, keeps_prior: Flags
    ) -> None:
        goal, base = self._evaluated(proposed, groups)
        powers = self._powers[groups, None]
        before = powers * self._goal[groups, own] + (1 - powers) * self._base[groups, own]
        after = powers * goal + (1 - powers) * base
        change = after - before
        theta = 0.5 * np.sum(
            x[..., self._lengths :] ** 2 - proposed[..., self._lengths :] ** 2, axis=2
        )
        change += np.where(keeps_prior, 0.0, theta)
        taken = (goal > _NOWHERE) & (np.log(self._rng.random(change.shape)) < change)
        for array, new in ((self._x, proposed), (self._goal, goal), (self._base, base)):
            part = array[groups, own]
            part[taken] = new[taken]
            array[groups, own] = part

    def _along_differences(self, x: Array, others: Array) -> Array:
        """Differential evolution, now and then by a whole difference, from peak to peak."""
        groups, count, size = x.shape
        pairs = self._rng.integers(others.shape[1], size=(2, groups, count))
        each = np.arange(groups)[:, None]
        away = others[each, pairs[0]] - others[each, pairs[1]]
        chosen = self._rng.random((groups, count, size)) < self._rng.random((groups, count, 1))
        dimensions = np.maximum(chosen.sum(axis=2, keepdims=True), 1)
        pace = 2.38 / np.sqrt(2 * dimensions) * self._rng.uniform(0.3, 1.1, (groups, count, 1))
        pace = np.where(self._rng.random((groups, count, 1)) < 0.1, 1.0, pace)
        spread = _JITTER * self._rng.standard_normal((groups, count, size))
        moved: Array = x + np.where(chosen, pace * away + spread * others.std(axis=1)[:, None], 0.0)
        return moved

    def _crank_nicolson(self, x: Array, slopes: Array) -> Array:
        """Leaves the prior of θ as it is; lengths follow."""
        theta = x[..., self._lengths :]
        pace = np.exp(self._rng.uniform(math.log(0.05), 0.0, (*x.shape[:2], 1)))
        chosen = self._rng.random(theta.shape) < self._rng.random((*x.shape[:2], 1))
        normal = self._rng.standard_normal(theta.shape)
        moved = np.where(chosen, np.sqrt(1 - pace**2) * theta + pace * normal, theta)
        lengths = x[..., : self._lengths] + (moved - theta) @ slopes
        return np.concatenate([lengths, moved], axis=2)

    def _lengths_alone(self, x: Array, roots: Array) -> Array:
        shape = (*x.shape[:2], self._lengths)
        pace = np.exp(self._rng.uniform(math.log(0.2), math.log(2.5), (*x.shape[:2], 1)))
        normal = self._rng.standard_normal(shape) / np.sqrt(
            self._rng.chisquare(_FREEDOM, (*x.shape[:2], 1)) / _FREEDOM
        )
        moved = x.copy()
        moved[..., : self._lengths] += pace * (normal @ np.swapaxes(roots, 1, 2))
        return moved


def _share(ratios: Array, powers: Array) -> Array:
    """Effective share of particles weighted by these powers of their ratios, shape (g,)."""
    logs = powers[:, None] * ratios
    weights = np.exp(logs - logs.max(axis=1, keepdims=True))
    shares: Array = weights.sum(axis=1) ** 2 / np.sum(weights**2, axis=1) / ratios.shape[1]
    return shares


def _regression(x: Array, lengths: int) -> tuple[Array, Array]:
    """How lengths depend on θ, shape (g, theta, lengths), and a root of what is left of them."""
    away = x - x.mean(axis=1, keepdims=True)
    own, theta = away[..., :lengths], away[..., lengths:]
    ridge = 0.05 * x.shape[1] * np.eye(theta.shape[2])
    square = np.swapaxes(theta, 1, 2) @ theta + ridge
    slopes = np.linalg.solve(square, np.swapaxes(theta, 1, 2) @ own)
    left = own - theta @ slopes
    covariance = np.swapaxes(left, 1, 2) @ left / x.shape[1] + 1e-10 * np.eye(lengths)
    return slopes, np.linalg.cholesky(covariance)
