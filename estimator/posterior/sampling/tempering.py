"""The evidence of sets of attachments, and particles, by tempered sequential Monte Carlo.

What is integrated over, for each set of attachments by itself, are its lengths, with a uniform
prior, and θ, the deviations from what is stated, with a normal prior. A reading changes smoothly
with these only between one set of contacts and the next, and masses show only in changes of
contacts, so that no single peak stands for the integral. Particles start from a known distribution:
mostly the normal approximation around the peaks, under half of the readings' information, and for
the rest the prior. From there they go to the posterior by powers from 0 to 1 of the ratio of both
densities, in steps that each keep a share of the particles' effective sample size::

    start = 0.9 mean over peaks of N(peak, (D + F / 2)⁻¹) + 0.1 prior
    target(power) = start (likelihood prior / start) ** power

F is the information of the readings, D the precision of the prior.

Between two powers they are moved along some axes of a normal distribution with the covariance of
their points before, by steps that leave it invariant (preconditioned Crank-Nicolson). Several sets
of attachments are computed side by side, each with powers of its own. Noise factors are integrated
on a grid.

So few moves are enough for the evidence, but particles with common ancestors stay correlated: those
that become samples of the posterior are moved for longer (``equilibrated``).

How carefully a robot was built is unknown: the spreads that care decides have a factor in common,
whose logarithm is one more θ. The other θ are in units of the spreads times that factor, so that
their prior density stays the same when it changes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.parameters.table import CARE
from estimator.posterior.model.gauss_newton import Free
from estimator.posterior.model.likelihood import GRAVITY_TILTS, Likelihood
from estimator.posterior.model.sensor_data import BRANCH
from estimator.posterior.model.special import logsumexp
from estimator.posterior.model.unknowns import Columns, Predictor
from estimator.posterior.sampling.normals import Normals, log_normal

_KEPT_ESS: Final = 0.6  # effective sample size after each step to the posterior, of all particles
_PEAK_WEIGHT: Final = 0.9  # of the normal distributions around peaks in the start distribution
_COUNTED_SHARE: Final = 0.5  # share of the readings' information in their precision
_MOVES: Final = 3  # moves after each step towards the posterior
_EQUILIBRATING: Final = 2  # moves of samples in the end, for each dimension
_SHORTEST: Final = 0.2  # shortest Crank-Nicolson step; the longest is 1, an independent draw
_BISECTIONS: Final = 30
_NOWHERE: Final = -1e9  # log-likelihood where lengths are out of their ranges
_TO_ALL_SIDES: Final = 8  # one in so many proposals may fall to any side
_MOST_STEPS: Final = 60  # largest number of steps towards the posterior
_PAD_LAST: Final = ((0, 0), (0, 0), (0, 1))


class Particles(NamedTuple):
    """Weighed particles of the posterior of one set of attachments.

    Attributes:
        log_evidence: Logarithm of the integral of the likelihood over lengths, θ and noise factors.
        values: Equally likely points, shape (particles, size).
        own: Their lengths and θ, in units of ranges and spreads, shape (particles, d).
        fits: Their log-likelihoods, noise factors integrated out, shape (particles,).
        ess: Number of different particles after the last resampling.
    """

    log_evidence: float
    values: Array
    own: Array
    fits: Array
    ess: float

    @property
    def best(self) -> Array:
        """The point that fits best, shape (size,)."""
        best: Array = self.values[np.argmax(self.fits)]
        return best


@dataclass(frozen=True, kw_only=True)
class Target:
    """The posteriors of g sets of attachments, each of which is integrated over.

    Attributes:
        peaks: Points of each set that explain the readings well, best first, shape (g, p, size).
        free: Columns of each set that are integrated over, lengths before θ.
        precision: Precision of these columns at the peaks, shape (g, p, d, d).
        by_care: Which of these columns have spreads that care decides, shape (g, d).
        predictor: Computes readings.
        likelihood: Likelihood of the observations.
        rng: Draws the particles.
    """

    peaks: Array
    free: Free
    precision: Array
    by_care: Flags
    predictor: Predictor
    likelihood: Likelihood
    rng: np.random.Generator

    def in_own_units(self) -> tuple[Array, Array, Flags]:
        """Peaks, precision there, and which dimensions are θ; with care's factor, if that is open.

        In units of ranges and spreads.
        """
        x = np.take_along_axis(self.peaks, self.free.columns[:, None], axis=2)
        x, precision, normal = x / self.free.spreads[:, None], self.precision, self.free.normal
        if self.by_care.any():
            x, normal = np.pad(x, _PAD_LAST), np.append(normal, True)
            precision = np.pad(precision, (*_PAD_LAST, (0, 1)))
            precision[..., -1, -1] = 1.0
        return x, precision, normal


def tempered(target: Target, particles: int) -> list[Particles]:
    """Evidence of several sets of attachments, and so many particles of each."""
    return _Run(target, particles).finished()


def equilibrated(target: Target, own: Array) -> Array:
    """Points of one set after enough moves to forget common ancestors, shape (n, size).

    Resampled particles descend from few; the more dimensions, the longer they stay correlated.

    Args:
        target: The posterior of that set.
        own: Lengths and θ of some of its particles (``Particles.own``), shape (n, d).
    """
    return _Run(target, len(own), own[None]).equilibrated()


class _Run:
    """Particles of g sets between the start distribution and the posterior.

    Args:
        target: The posteriors.
        count: Particles of each set.
        arrived: Particles of the posterior to begin with, shape (g, count, d).
    """

    def __init__(self, target: Target, count: int, arrived: Array | None = None) -> None:
        self._target, self._count, self._rng = target, count, target.rng
        self._around = partial(Normals.around, *target.in_own_units())
        self._lengths = int(np.count_nonzero(~target.free.normal))
        groups = np.arange(len(target.peaks))
        self._start = self._around(_COUNTED_SHARE)
        self._ess = np.full(groups.size, float(count))
        self._x = self._drawn_at_start() if arrived is None else arrived
        interactions = len(target.likelihood)
        self._sides = np.zeros((groups.size, interactions, len(GRAVITY_TILTS)), dtype=bool)
        self._fits = self._fits_at(self._x, groups, one_in=1)
        self._base = self._log_start(self._x, groups)
        self._powers = np.full(groups.size, 0.0 if arrived is None else 1.0)
        self._log_evidence = np.zeros(groups.size)

    def _drawn_at_start(self) -> Array:
        sets, peaks, size = self._start.mean.shape
        normal = self._rng.standard_normal((sets, self._count, size))
        drawn = normal.copy()
        drawn[..., : self._lengths] = self._rng.random((sets, self._count, self._lengths))
        at_peak = self._rng.random((sets, self._count)) < _PEAK_WEIGHT
        peak = np.where(at_peak, 1 + self._rng.integers(peaks, size=at_peak.shape), 0)
        return np.choose(peak[..., None], [drawn, *self._start.coloured(normal)])

    def _log_start(self, x: Array, groups: Columns) -> Array:
        """Log-density of the start distribution, shape (g, n), at points of shape (g, n, d)."""
        log_weight = math.log(_PEAK_WEIGHT / self._start.mean.shape[1])
        near_peaks = log_weight + self._start.log_densities(x, groups)
        prior = math.log(1 - _PEAK_WEIGHT) + self._log_prior(x)
        log_density: Array = np.logaddexp.reduce([prior, *near_peaks])
        return log_density

    def finished(self) -> list[Particles]:
        """Particles of the posterior."""
        groups = np.arange(len(self._x))
        self._resample(groups, np.where(self._fits > _NOWHERE, 0.0, _NOWHERE))
        for _ in range(_MOST_STEPS):
            going = np.flatnonzero(self._powers < 1)
            if not going.size:
                break
            self._go_on(going)
            around = Normals.with_covariance_of(self._x[going])
            for _ in range(_MOVES):
                self._move(going, around)
        return [self._particles(group) for group in groups.tolist()]

    def equilibrated(self) -> Array:
        """Points of the posterior of the only set after further moves, shape (count, size)."""
        groups, around = np.zeros(1, dtype=np.intp), self._around(1.0)
        for _ in range(_EQUILIBRATING * self._x.shape[2]):
            self._move(groups, around)
        return self._values(groups.repeat(self._count), self._x[0])

    def _particles(self, group: int) -> Particles:
        return Particles(
            log_evidence=float(self._log_evidence[group]),
            values=self._values(np.full(self._count, group), self._x[group]),
            own=self._x[group].copy(),
            fits=self._fits[group].copy(),
            ess=float(self._ess[group]),
        )

    def _fits_at(self, x: Array, groups: Columns, one_in: int = _TO_ALL_SIDES) -> Array:
        """Log-likelihoods, shape (g, n).

        Bodies may fall to the sides to which others of their set have fallen, and one of every
        ``one_in`` to all.
        """
        lengths = x[..., : self._lengths]
        inside = np.all((lengths >= 0) & (lengths <= 1), axis=2)
        which, _ = np.nonzero(inside)
        fits: Array = np.full(inside.shape, _NOWHERE)
        values = self._values(groups[which], x[inside])
        likelihood, owners = self._target.likelihood, groups[which]
        sides = self._sides[owners]
        sides[::one_in] = True
        misfits = likelihood.misfits_of(self._target.predictor, values, sides=sides)
        fallen = misfits[..., BRANCH].astype(np.intp)
        self._sides[owners[:, None], np.arange(len(likelihood)), fallen] = True
        fits[inside] = likelihood.integrated(misfits)
        return fits

    def _log_prior(self, x: Array) -> Array:
        return log_normal(x[..., self._lengths :])

    def _values(self, groups: Columns, x: Array) -> Array:
        """Points, shape (n, size), of groups, shape (n,), by lengths and θ, shape (n, d)."""
        values: Array = self._target.peaks[groups, 0].copy()
        spreads = self._target.free.spreads[groups]
        if x.shape[1] > spreads.shape[1]:
            care = np.exp(CARE * x[:, -1:])
            spreads = np.where(self._target.by_care[groups], care, 1.0) * spreads
        fitted = x[:, : spreads.shape[1]] * spreads
        np.put_along_axis(values, self._target.free.columns[groups], fitted, axis=1)
        return values

    def _go_on(self, going: Columns) -> None:
        """Takes the next power of each group, and resamples its particles."""
        ratios = self._fits[going] + self._log_prior(self._x[going]) - self._base[going]
        low, high = self._powers[going].copy(), np.ones(going.size)
        current = low.copy()
        can_finish = _share(ratios, high - current) >= _KEPT_ESS
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            enough = _share(ratios, middle - current) >= _KEPT_ESS
            low, high = np.where(enough, middle, low), np.where(enough, high, middle)
        powers = np.where(can_finish, 1.0, low)
        self._powers[going] = powers
        self._resample(going, (powers - current)[:, None] * ratios)

    def _resample(self, groups: Columns, logs: Array) -> None:
        """Resamples the particles of some groups by the logarithms of their weights."""
        self._log_evidence[groups] += logsumexp(logs, axis=1) - math.log(self._count)
        weights = np.exp(logs - logs.max(axis=1, keepdims=True))
        ends = np.cumsum(weights, axis=1)
        starts = (np.arange(self._count) + self._rng.random((groups.size, 1))) / self._count
        for group, row_ends, row_starts in zip(groups.tolist(), ends, starts, strict=True):
            rows = np.searchsorted(row_ends, row_starts * row_ends[-1], side="right")
            rows = self._rng.permutation(np.minimum(rows, self._count - 1))
            self._ess[group] = np.unique(rows).size
            for array in (self._x, self._fits, self._base):
                array[group] = array[group, rows]

    def _move(self, groups: Columns, around: Normals) -> None:
        """Proposes moves of the particles of some sets, and accepts by Metropolis-Hastings.

        Args:
            groups: Sets whose particles are moved.
            around: One normal distribution of each, which proposals along some of its axes leave
                invariant.
        """
        x = self._x[groups]
        shape = (*x.shape[:2], 1)
        (white,) = around.whitened(x)
        axes = self._rng.random(x.shape) < self._rng.random(shape)
        pace = np.where(axes, np.exp(self._rng.uniform(math.log(_SHORTEST), 0.0, shape)), 0.0)
        moved = np.sqrt(1 - pace**2) * white + pace * self._rng.standard_normal(x.shape)
        (proposed,) = around.coloured(moved)
        fits, base = self._fits_at(proposed, groups), self._log_start(proposed, groups)
        powers = self._powers[groups, None]
        before = powers * (self._fits[groups] + self._log_prior(x))
        before += (1 - powers) * self._base[groups]
        after = powers * (fits + self._log_prior(proposed)) + (1 - powers) * base
        chances = after - before + log_normal(white) - log_normal(moved)
        taken = (fits > _NOWHERE) & (np.log(self._rng.random(chances.shape)) < chances)
        for array, new in ((self._x, proposed), (self._fits, fits), (self._base, base)):
            updated = array[groups]
            updated[taken] = new[taken]
            array[groups] = updated


def _share(ratios: Array, powers: Array) -> Array:
    """Effective sample size, as a share, of weights: ratios to these powers; shape (g,)."""
    logs = powers[:, None] * ratios
    weights = np.exp(logs - logs.max(axis=1, keepdims=True))
    shares: Array = weights.sum(axis=1) ** 2 / np.sum(weights**2, axis=1) / ratios.shape[1]
    return shares
