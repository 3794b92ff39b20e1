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

Between two powers they are moved by proposals that their points before shape: differential
evolution; steps along some axes of a normal distribution with the covariance of those points, which
leave that distribution invariant (preconditioned Crank-Nicolson); and such steps of random subsets
of θ alone that leave its prior invariant, lengths following as they depend on θ. Several sets of
attachments are computed side by side, each with powers of its own. Noise factors are integrated on
a grid.

So few moves are enough for the evidence, but particles with common ancestors stay correlated: those
that become samples of the posterior are moved for longer, by the normal distribution at the peak
and by differences of the points that they began with (``equilibrated``).

How carefully a robot was built is unknown: the spreads that care decides have a factor in common,
whose logarithm is one more θ. The others are in units of the spreads times that factor, so that
their prior density stays the same when it changes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
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

_KEPT: Final = 0.6  # effective sample size after each step towards the posterior, of all particles
_NEAR: Final = 0.9  # weight of the normal distributions around peaks in the start distribution
_COUNTS: Final = 0.5  # share of the readings' information in their precision
_MOVES: Final = 3  # after each step towards the posterior
_EQUILIBRATING: Final = 2  # moves of samples in the end, for each dimension
_JITTER: Final = 1e-3  # of differential evolution, in standard deviations of these points
_KINDS: Final = (0.2, 0.5, 0.3)  # shares of the three kinds of moves, in the order above
_SHORTEST: Final = 0.5  # shortest Crank-Nicolson step; the longest is 1, an independent draw
_BISECTIONS: Final = 30
_NOWHERE: Final = -1e9  # log-likelihood where lengths are out of their ranges
_TO_ALL_SIDES: Final = 8  # one in so many proposals may fall to any side
_MOST_STEPS: Final = 60  # towards the posterior
_ONE_MORE: Final = ((0, 0), (0, 0), (0, 1))


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


@dataclass(frozen=True, kw_only=True)
class Target:
    """The posteriors of g sets of attachments, each of which is integrated over.

    Attributes:
        peaks: Points of each that explain the readings well, the best first, shape (g, p, size).
        free: Columns of each that are integrated over, lengths before θ.
        precision: Of these at the peaks, shape (g, p, d, d).
        by_care: Which of them have spreads that care decides, shape (g, d).
        predictor: Computes readings.
        likelihood: Of the observations.
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
        """Peaks, the precision there, and which dimensions are θ; with care's factor, if open."""
        own = np.take_along_axis(self.peaks, self.free.columns[:, None], axis=2)
        own, precision, normal = own / self.free.spreads[:, None], self.precision, self.free.normal
        if self.by_care.any():
            own, normal = np.pad(own, _ONE_MORE), np.append(normal, True)
            precision = np.pad(precision, (*_ONE_MORE, (0, 1)))
            precision[..., -1, -1] = 1.0
        return own, precision, normal


def tempered(target: Target, particles: int, times: int = 1) -> list[Particles]:
    """Evidence and particles of several sets of attachments.

    Args:
        target: Their posteriors.
        particles: For each; even.
        times: Factor on the number of moves after each step towards the posterior.
    """
    return _Run(target, particles).finished(times * _MOVES)


def equilibrated(target: Target, own: Array) -> Array:
    """Points of one set after enough moves to forget common ancestors, shape (n, size).

    Resampled particles descend from few; the more dimensions, the longer they stay correlated.

    Args:
        target: The posterior of that set.
        own: Some of its particles, shape (n, d).
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
        self._peaks, self._precision, self._normal = target.in_own_units()
        self._lengths = int(np.count_nonzero(~self._normal))
        groups = np.arange(len(self._peaks))
        counts = np.full(groups.size, _COUNTS)
        self._start = Normals.around(self._peaks, self._precision, self._normal, counts)
        self._ess = np.full(groups.size, float(count))
        self._x = self._drawn_at_start() if arrived is None else arrived
        interactions = len(target.likelihood)
        self._sides = np.zeros((groups.size, interactions, len(GRAVITY_TILTS)), dtype=bool)
        self._fits = self._fits_at(self._x, groups, one_in=1)
        self._base = self._log_start(self._x, groups)
        self._powers = np.full(groups.size, 0.0 if arrived is None else 1.0)
        self._log_evidence = np.zeros(groups.size)

    def _drawn_at_start(self) -> Array:
        sets, peaks, size = self._peaks.shape
        normal = self._rng.standard_normal((sets, self._count, size))
        drawn = normal.copy()
        drawn[..., : self._lengths] = self._rng.random((sets, self._count, self._lengths))
        near = self._rng.random((sets, self._count)) < _NEAR
        peak = np.where(near, 1 + self._rng.integers(peaks, size=near.shape), 0)
        return np.choose(peak[..., None], [drawn, *self._start.coloured(normal)])

    def _log_start(self, x: Array, groups: Columns) -> Array:
        """Log-density of the start distribution, shape (g, n), at points of shape (g, n, d)."""
        each = math.log(_NEAR / self._peaks.shape[1])
        near = each + self._start.log_densities(x, groups)
        prior = math.log(1 - _NEAR) + self._log_prior(x)
        log_density: Array = np.logaddexp.reduce([prior, *near])
        return log_density

    def finished(self, moves: int) -> list[Particles]:
        """Particles of the posterior, reached with so many moves after each step."""
        groups = np.arange(len(self._x))
        self._resample(groups, np.where(self._fits > _NOWHERE, 0.0, _NOWHERE))
        for _ in range(_MOST_STEPS):
            going = np.flatnonzero(self._powers < 1)
            if not going.size:
                break
            self._go_on(going)
            others = self._x[going].copy()
            around = Normals.with_covariance_of(others, self._lengths)
            for _ in range(moves):
                self._move(going, others, around)
        self._weigh_other_sides(groups)
        return [self._particles(group) for group in groups.tolist()]

    def equilibrated(self) -> Array:
        """Points of the posterior of the only set after further moves, shape (count, size)."""
        only = np.zeros(1, dtype=np.intp)
        around = Normals.around(self._peaks, self._precision, self._normal, np.ones(1))
        others = self._x.copy()
        for _ in range(_EQUILIBRATING * self._x.shape[2]):
            self._move(only, others, around)
        self._weigh_other_sides(only)
        return self._values(only.repeat(self._count), self._x[0])

    def _weigh_other_sides(self, groups: Columns) -> None:
        """Weighs particles by what sides explain to which none has fallen before."""
        before, self._fits = self._fits, self._fits_at(self._x, groups, one_in=1)
        missed = np.flatnonzero(np.any(self._fits != before, axis=1))
        if missed.size:
            self._resample(missed, (self._fits - before)[missed])

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

        Bodies may fall to the sides to which others of their set have fallen, and one in so many to
        all.
        """
        lengths = x[..., : self._lengths]
        inside = np.all((lengths >= 0) & (lengths <= 1), axis=2)
        which, _ = np.nonzero(inside)
        fits: Array = np.full(inside.shape, _NOWHERE)
        values = self._values(groups[which], x[inside])
        likelihood, own = self._target.likelihood, groups[which]
        sides = self._sides[own]
        sides[::one_in] = True
        misfits = likelihood.misfits_of(self._target.predictor, values, sides=sides)
        fallen = misfits[..., BRANCH].astype(np.intp)
        self._sides[own[:, None], np.arange(len(likelihood)), fallen] = True
        fits[inside] = likelihood.integrated(misfits)
        return fits

    def _log_prior(self, x: Array) -> Array:
        return log_normal(x[..., self._lengths :])

    def _values(self, groups: Columns, x: Array) -> Array:
        """Points of groups, shape (n,), with lengths and θ of shape (n, d); shape (n, size)."""
        values: Array = self._target.peaks[groups, 0].copy()
        spreads = self._target.free.spreads[groups]
        if x.shape[1] > spreads.shape[1]:
            care = np.exp(CARE * x[:, -1:])
            spreads = np.where(self._target.by_care[groups], care, 1.0) * spreads
        own = x[:, : spreads.shape[1]] * spreads
        np.put_along_axis(values, self._target.free.columns[groups], own, axis=1)
        return values

    def _go_on(self, going: Columns) -> None:
        """Takes the next power of each group, and resamples its particles."""
        ratios = self._fits[going] + self._log_prior(self._x[going]) - self._base[going]
        low, high = self._powers[going].copy(), np.ones(going.size)
        here = low.copy()
        whole = _share(ratios, high - here) >= _KEPT
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            enough = _share(ratios, middle - here) >= _KEPT
            low, high = np.where(enough, middle, low), np.where(enough, high, middle)
        powers = np.where(whole, 1.0, low)
        self._powers[going] = powers
        self._resample(going, (powers - here)[:, None] * ratios)

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

    def _move(self, groups: Columns, others: Array, around: Normals) -> None:
        """Moves particles by proposals of all kinds, a share by each.

        Args:
            groups: Sets whose particles are moved.
            others: Points that are not moved, whose differences are proposed, shape (g, n, d).
            around: Normal distributions that proposals leave invariant.
        """
        x = self._x[groups]
        proposed, kept = x.copy(), np.zeros(x.shape[:2])
        kinds = [self._along_differences, self._towards, self._theta_alone]
        ends = np.cumsum(_KINDS[: 3 if self._lengths < x.shape[2] else 2])
        places = (self._rng.permutation(x.shape[1]) + self._rng.random()) / x.shape[1]
        kind = np.searchsorted(ends, places * ends[-1], side="right")
        for number, propose in enumerate(kinds):
            rows = np.flatnonzero(kind == number)
            if rows.size:
                proposed[:, rows], kept[:, rows] = propose(x[:, rows], others, around)
        self._accept(groups, proposed, kept)

    def _accept(self, groups: Columns, proposed: Array, kept: Array) -> None:
        """Metropolis-Hastings; ``kept``: log-ratios of densities that proposals leave invariant."""
        x, fits = self._x[groups], self._fits_at(proposed, groups)
        base = self._log_start(proposed, groups)
        powers = self._powers[groups, None]
        before = powers * (self._fits[groups] + self._log_prior(x))
        before += (1 - powers) * self._base[groups]
        after = powers * (fits + self._log_prior(proposed)) + (1 - powers) * base
        chances = after - before + kept
        taken = (fits > _NOWHERE) & (np.log(self._rng.random(chances.shape)) < chances)
        for array, new in ((self._x, proposed), (self._fits, fits), (self._base, base)):
            part = array[groups]
            part[taken] = new[taken]
            array[groups] = part

    def _along_differences(self, x: Array, others: Array, around: Normals) -> tuple[Array, Array]:
        """Differential evolution; a tenth of the steps are whole differences, from peak to peak."""
        groups, count, size = x.shape
        pairs = self._rng.integers(others.shape[1], size=(2, groups, count))
        each = np.arange(groups)[:, None]
        difference = others[each, pairs[0]] - others[each, pairs[1]]
        chosen = self._rng.random((groups, count, size)) < self._rng.random((groups, count, 1))
        dimensions = np.maximum(chosen.sum(axis=2, keepdims=True), 1)
        pace = 2.38 / np.sqrt(2 * dimensions) * self._rng.uniform(0.3, 1.1, (groups, count, 1))
        pace = np.where(self._rng.random((groups, count, 1)) < 0.1, 1.0, pace)
        spread = _JITTER * self._rng.standard_normal((groups, count, size))
        step = pace * difference + spread * others.std(axis=1)[:, None]
        return x + np.where(chosen, step, 0.0), np.zeros((groups, count))

    def _towards(self, x: Array, others: Array, around: Normals) -> tuple[Array, Array]:
        """Leaves a normal distribution invariant, along some of its axes (Crank-Nicolson)."""
        peak = self._peak_of_each(x, around)
        white = np.choose(peak, around.whitened(x))
        some = self._rng.random(x.shape) < self._rng.random((*x.shape[:2], 1))
        pace = np.where(some, self._pace(x), 0.0)
        moved = np.sqrt(1 - pace**2) * white + pace * self._rng.standard_normal(x.shape)
        proposed = np.choose(peak, around.coloured(moved))
        return proposed, log_normal(white) - log_normal(moved)

    def _theta_alone(self, x: Array, others: Array, around: Normals) -> tuple[Array, Array]:
        """Leaves the prior of θ invariant; lengths follow (Crank-Nicolson)."""
        theta, pace = x[..., self._lengths :], self._pace(x)
        chosen = self._rng.random(theta.shape) < self._rng.random((*x.shape[:2], 1))
        drawn = np.sqrt(1 - pace**2) * theta + pace * self._rng.standard_normal(theta.shape)
        moved = np.where(chosen, drawn, theta)
        follow = np.swapaxes((moved - theta)[:, None] @ around.slopes, 0, 1)
        lengths = x[..., : self._lengths] + np.choose(self._peak_of_each(x, around), follow)
        return np.concatenate([lengths, moved], axis=2), log_normal(theta) - log_normal(moved)

    def _peak_of_each(self, x: Array, around: Normals) -> Columns:
        return self._rng.integers(around.mean.shape[1], size=(*x.shape[:2], 1))

    def _pace(self, x: Array) -> Array:
        pace: Array = np.exp(self._rng.uniform(math.log(_SHORTEST), 0.0, (*x.shape[:2], 1)))
        return pace


def _share(ratios: Array, powers: Array) -> Array:
    """Effective sample size of weights, the ratios to these powers, as a share; shape (g,)."""
    logs = powers[:, None] * ratios
    weights = np.exp(logs - logs.max(axis=1, keepdims=True))
    shares: Array = weights.sum(axis=1) ** 2 / np.sum(weights**2, axis=1) / ratios.shape[1]
    return shares
