"""The evidence of sets of attachments, and particles, by tempered sequential Monte Carlo.

What is integrated over, for each set of attachments by itself, are its lengths, uniform beforehand,
and θ, what else may be otherwise than stated, normal beforehand. A reading changes with these
smoothly between one set of contacts and the next only, and of masses only changes of contacts tell,
so that no single peak stands for the integral. Particles start from a distribution that is known:
what a likelihood that counts half would leave, were it as at one of the peaks everywhere, with some
drawn from the prior. From there they go to the posterior by powers from 0 to 1 of the ratio of
both, each so much larger that the particles' weights keep a share of their effective size::

    start = 0.9 mean over peaks of N(peak, (D + F / 2)⁻¹) + 0.1 prior
    target(power) = start (likelihood prior / start) ** power

F is the information of the readings, D the precision of the prior.

Between two powers they are moved, each half by what the other half knows: along differences of two
others (differential evolution); along some axes of a normal distribution as wide as the others, by
a step that leaves it as it is; θ alone by such steps that leave its prior as it is, in random
subsets of it, lengths following as they depend on θ. Several sets of attachments are computed side
by side, each with powers of its own. Noise factors are integrated on a grid.

So few moves are enough for the evidence, but particles stay nearer to each other than they should:
those that stand for the posterior in the end go on for longer, in steps that leave the normal
distribution at the peak as it is, which does not depend on where they are (``settled``).

How carefully a robot was built is not known: the spreads that care decides have a factor in common,
whose logarithm is one θ more. The others are in units of what it makes of their spreads, so that
they stay as probable when it changes.
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
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.special import logsumexp
from estimator.posterior.model.unknowns import Columns, Predictor
from estimator.posterior.sampling.normals import Normals, log_normal

_KEPT: Final = 0.6  # effective share of particles after each step towards the posterior
_NEAR: Final = 0.9  # share of the start that lies around the best point
_COUNTS: Final = 0.5  # of the information there
_MOVES: Final = 3  # after each step
_SETTLING: Final = 2  # of samples in the end, for each dimension
_JITTER: Final = 1e-3
_KINDS: Final = (0.2, 0.5, 0.3)  # shares of the moves, in the order above
_SHORTEST: Final = 0.5  # step of those that keep a normal distribution; the longest is 1
_BISECTIONS: Final = 30
_NOWHERE: Final = -1e9  # log-likelihood where there is no body
_MOST_STEPS: Final = 60  # towards the posterior
_ONE_MORE: Final = ((0, 0), (0, 0), (0, 1))


class Particles(NamedTuple):
    """What stands for the posterior of one set of attachments.

    Attributes:
        log_evidence: Logarithm of the integral of the likelihood over lengths, θ and noise factors.
        values: Equally likely points, shape (particles, size).
        own: What is integrated over of these, in its own units, shape (particles, d).
        fits: Their log-likelihoods, noise factors integrated out, shape (particles,).
        ess: How many were different when they were drawn by their weights for the last time.
    """

    log_evidence: float
    values: Array
    own: Array
    fits: Array
    ess: float


@dataclass(frozen=True, kw_only=True)
class Target:
    """What is integrated over, of g sets of attachments, and by what.

    Attributes:
        peaks: Points of each that explain readings well, the best first, shape (g, p, size).
        free: What is integrated over, lengths before parameters, of each.
        precision: Of these there, shape (g, p, d, d).
        by_care: Which parameters' spreads have a factor in common that is not known, shape (g, d).
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
        target: These.
        particles: For each; even.
        times: As many moves as usual after each step towards the posterior.
    """
    return _Run(target, particles).finished(times * _MOVES)


def settled(target: Target, own: Array) -> Array:
    """Points of one set that have moved until they stray as far as they should, shape (n, size).

    Particles that were drawn by their weights have common ancestors; the more dimensions, the
    longer they stay near these.

    Args:
        target: The set.
        own: Some of its particles, shape (n, d), n even.
    """
    return _Run(target, len(own), own[None]).settled()


class _Run:
    """Particles on their way.

    Args:
        target: Where to.
        count: Particles of each set.
        arrived: Those that are there already, shape (g, count, d).
    """

    def __init__(self, target: Target, count: int, arrived: Array | None = None) -> None:
        self._target, self._count, self._rng = target, count, target.rng
        self._peaks, self._precision, self._normal = target.in_own_units()
        self._lengths = int(np.count_nonzero(~self._normal))
        everyone = np.arange(len(self._peaks))
        counts = np.full(everyone.size, _COUNTS)
        self._start = Normals.around(self._peaks, self._precision, self._normal, counts)
        self._ess = np.full(everyone.size, float(count))
        self._x = self._drawn_at_start() if arrived is None else arrived
        self._fits = self._fits_at(self._x, everyone)
        self._base = self._log_start(self._x, everyone)
        self._powers = np.full(everyone.size, 0.0 if arrived is None else 1.0)
        self._log_evidence = np.zeros(everyone.size)

    def _drawn_at_start(self) -> Array:
        sets, peaks, size = self._peaks.shape
        normal = self._rng.standard_normal((sets, self._count, size))
        drawn = normal.copy()
        drawn[..., : self._lengths] = self._rng.random((sets, self._count, self._lengths))
        near = self._rng.random((sets, self._count)) < _NEAR
        peak = np.where(near, 1 + self._rng.integers(peaks, size=near.shape), 0)
        return np.choose(peak[..., None], [drawn, *self._start.near(normal)])

    def _log_start(self, x: Array, groups: Columns) -> Array:
        """Of points of the groups, shape (g, n, d) in; as if lengths were inside their ranges."""
        each = math.log(_NEAR / self._peaks.shape[1])
        near = each + self._start.log_densities(x, groups)
        prior = math.log(1 - _NEAR) + self._log_prior(x)
        log_density: Array = np.logaddexp.reduce([prior, *near])
        return log_density

    def finished(self, moves: int) -> list[Particles]:
        """Goes to the posterior, with so many moves after each step."""
        everyone = np.arange(len(self._x))
        self._drawn_anew(everyone, np.where(self._fits > _NOWHERE, 0.0, _NOWHERE))
        for _ in range(_MOST_STEPS):
            going = np.flatnonzero(self._powers < 1)
            if not going.size:
                break
            self._go_on(going)
            for _ in range(moves):
                self._move(going)
        return [self._particles(group) for group in everyone.tolist()]

    def settled(self) -> Array:
        """Stays there; the points then, shape (count, size)."""
        only = np.zeros(1, dtype=np.intp)
        around = Normals.around(self._peaks, self._precision, self._normal, np.ones(1))
        for _ in range(_SETTLING * self._x.shape[2]):
            self._move(only, around)
        return self._values(only.repeat(self._count), self._x[0])

    def _particles(self, group: int) -> Particles:
        return Particles(
            log_evidence=float(self._log_evidence[group]),
            values=self._values(np.full(self._count, group), self._x[group]),
            own=self._x[group].copy(),
            fits=self._fits[group].copy(),
            ess=float(self._ess[group]),
        )

    def _fits_at(self, x: Array, groups: Columns) -> Array:
        """Log-likelihoods, shape (g, n)."""
        lengths = x[..., : self._lengths]
        inside = np.all((lengths >= 0) & (lengths <= 1), axis=2)
        which, _ = np.nonzero(inside)
        fits: Array = np.full(inside.shape, _NOWHERE)
        values = self._values(groups[which], x[inside])
        likelihood = self._target.likelihood
        fits[inside] = likelihood.integrated(likelihood.misfits_of(self._target.predictor, values))
        return fits

    def _log_prior(self, x: Array) -> Array:
        return log_normal(x[..., self._lengths :])

    def _values(self, groups: Columns, x: Array) -> Array:
        """Points of n groups, shape (n,), with what is integrated over, shape (n, d)."""
        values: Array = self._target.peaks[groups, 0].copy()
        spreads = self._target.free.spreads[groups]
        if x.shape[1] > spreads.shape[1]:
            *_, away = x.T
            care = np.exp(CARE * away)[:, None]
            spreads = np.where(self._target.by_care[groups], care, 1.0) * spreads
        own = x[:, : spreads.shape[1]] * spreads
        np.put_along_axis(values, self._target.free.columns[groups], own, axis=1)
        return values

    def _go_on(self, going: Columns) -> None:
        """Takes the next power of each group, by which the particles are drawn anew."""
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
            for array in (self._x, self._fits, self._base):
                array[group] = array[group, rows]

    def _move(self, groups: Columns, known: Normals | None = None) -> None:
        """Moves both halves, each by what the other knows.

        Args:
            groups: Of these sets.
            known: Normal distributions that resemble their targets; by default the other half does.
        """
        half = self._count // 2
        halves = slice(None, half), slice(half, None)
        for own, other in (halves, halves[::-1]):
            x, others = self._x[groups, own], self._x[groups, other]
            around = known or Normals.as_wide_as(others, self._lengths)
            peak = self._rng.integers(around.mean.shape[1], size=x.shape[:2])
            shares = np.array(_KINDS if self._lengths < x.shape[2] else _KINDS[:-1])
            kind = self._rng.choice(shares.size, size=x.shape[:2], p=shares / shares.sum())
            proposed = np.choose(
                kind[..., None],
                [
                    self._along_differences(x, others),
                    self._towards(x, around, peak),
                    self._theta_alone(x, around, peak),
                ],
            )
            kept = np.choose(
                kind,
                [
                    0.0,
                    np.choose(peak, around.log_densities(x))
                    - np.choose(peak, around.log_densities(proposed)),
                    self._log_prior(x) - self._log_prior(proposed),
                ],
            )
            self._accept(groups, own, proposed, kept)

    def _accept(self, groups: Columns, own: slice, proposed: Array, kept: Array) -> None:
        """Takes proposals, of steps that keep a density with the logarithm of its ratio."""
        x, fits = self._x[groups, own], self._fits_at(proposed, groups)
        base = self._log_start(proposed, groups)
        powers = self._powers[groups, None]
        before = powers * (self._fits[groups, own] + self._log_prior(x))
        before += (1 - powers) * self._base[groups, own]
        after = powers * (fits + self._log_prior(proposed)) + (1 - powers) * base
        chances = after - before + kept
        taken = (fits > _NOWHERE) & (np.log(self._rng.random(chances.shape)) < chances)
        for array, new in ((self._x, proposed), (self._fits, fits), (self._base, base)):
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

    def _towards(self, x: Array, around: Normals, peak: Columns) -> Array:
        """Leaves a normal distribution as it is; along some of its axes."""
        away = np.choose(peak[..., None], around.away(x))
        some = self._rng.random(x.shape) < self._rng.random((*x.shape[:2], 1))
        pace = np.where(some, self._pace(x), 0.0)
        moved = np.sqrt(1 - pace**2) * away + pace * self._rng.standard_normal(x.shape)
        return np.choose(peak[..., None], around.near(moved))

    def _theta_alone(self, x: Array, around: Normals, peak: Columns) -> Array:
        """Leaves the prior of θ as it is; lengths follow (preconditioned Crank-Nicolson)."""
        theta, pace = x[..., self._lengths :], self._pace(x)
        chosen = self._rng.random(theta.shape) < self._rng.random((*x.shape[:2], 1))
        drawn = np.sqrt(1 - pace**2) * theta + pace * self._rng.standard_normal(theta.shape)
        moved = np.where(chosen, drawn, theta)
        follow = np.swapaxes((moved - theta)[:, None] @ around.slopes, 0, 1)
        lengths = x[..., : self._lengths] + np.choose(peak[..., None], follow)
        return np.concatenate([lengths, moved], axis=2)

    def _pace(self, x: Array) -> Array:
        pace: Array = np.exp(self._rng.uniform(math.log(_SHORTEST), 0.0, (*x.shape[:2], 1)))
        return pace


def _share(ratios: Array, powers: Array) -> Array:
    """Effective share of particles weighted by these powers of their ratios, shape (g,)."""
    logs = powers[:, None] * ratios
    weights = np.exp(logs - logs.max(axis=1, keepdims=True))
    shares: Array = weights.sum(axis=1) ** 2 / np.sum(weights**2, axis=1) / ratios.shape[1]
    return shares
