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
others (differential evolution); towards a normal distribution as wide as the others, by a step that
leaves it as it is; θ alone by such steps that leave its prior as it is, in random subsets of it,
lengths following as they depend on θ. Several sets of attachments are computed side by side, each
with powers of its own. Noise factors are integrated on a grid.

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
from estimator.posterior.model.gauss_newton import PRIOR, Free
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.special import logsumexp
from estimator.posterior.model.unknowns import Columns, Predictor

_KEPT: Final = 0.6  # effective share of particles after each step towards the posterior
_NEAR: Final = 0.9  # share of the start that lies around the best point
_COUNTS: Final = 0.5  # of the information there
_AT_LEAST: Final = 0.02  # standard deviation of a length there, of its range
_MOVES: Final = 3  # after each step
_LAST: Final = 6  # more in the end
_JITTER: Final = 1e-3
_KINDS: Final = (0.3, 0.4, 0.3)  # shares of the moves, in the order above
_SHORTEST: Final = (0.1, 0.05)  # step of those that keep a normal distribution; the longest is 1
_LEAST: Final = 1e-10  # variance
_BISECTIONS: Final = 30
_NOWHERE: Final = -1e9  # log-likelihood where there is no body
_MOST_STEPS: Final = 60  # towards the posterior
_ONE_MORE: Final = ((0, 0), (0, 0), (0, 1))
_LOG_ROOT: Final = 0.5 * math.log(2 * math.pi)


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
    """The distribution at power 0 for g sets of attachments, each by p peaks in d dimensions."""

    lengths: int
    mean: Array
    root: Array
    inverse: Array
    log_peak: Array

    @classmethod
    def around(cls, peaks: Array, precision: Array, normal: Flags) -> _Start:
        """Where a likelihood that counts less would leave them, if it were so everywhere.

        Args:
            peaks: Of each set, shape (g, p, d).
            precision: Of lengths and θ there, the prior's included, shape (g, p, d, d).
            normal: Which are θ, shape (d,).
        """
        prior = np.diag(np.where(normal, 1.0, PRIOR))
        flatter = prior + _COUNTS * (precision - prior)
        covariance = np.asarray(np.linalg.inv(flatter))
        covariance += np.diag(np.where(normal, 0.0, _AT_LEAST**2))
        theta = np.where(normal, peaks, 0.0)  # the prior's middle draws it, and no length
        climb = _COUNTS * (precision @ theta[..., None])
        mean = np.where(normal, 0.0, peaks) + np.linalg.solve(flatter, climb)[..., 0]
        root = np.asarray(np.linalg.cholesky(covariance))
        log_root = np.log(np.diagonal(root, axis1=2, axis2=3)).sum(axis=2)
        return cls(
            lengths=int(np.count_nonzero(~normal)),
            mean=mean,
            root=root,
            inverse=np.asarray(np.linalg.inv(root)),
            log_peak=-_LOG_ROOT * peaks.shape[2] - log_root,
        )

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        groups, peaks, size = self.mean.shape
        normal = rng.standard_normal((groups, count, size))
        drawn = np.concatenate(
            [rng.random((groups, count, self.lengths)), normal[..., self.lengths :]], axis=2
        )
        peak = np.where(
            rng.random((groups, count)) < _NEAR, rng.integers(peaks, size=(groups, count)), -1
        )
        for one in range(peaks):
            near = self.mean[:, one, None] + normal @ np.swapaxes(self.root[:, one], 1, 2)
            drawn = np.where((peak == one)[..., None], near, drawn)
        return drawn

    def log_density(self, x: Array, groups: Columns) -> Array:
        """Of points of the groups, shape (g, n, d) in; as if lengths were inside their ranges."""
        density = math.log(1 - _NEAR) + _log_normal(x[..., self.lengths :])
        peaks = self.mean.shape[1]
        for one in range(peaks):
            away = x - self.mean[groups, one, None]
            inverse = np.swapaxes(self.inverse[groups, one], 1, 2)
            near = self.log_peak[groups, one, None] - 0.5 * np.sum((away @ inverse) ** 2, axis=2)
            density = np.logaddexp(density, math.log(_NEAR / peaks) + near)
        return density


def tempered(
    peaks: Array,
    free: Free,
    precision: Array,
    *,
    by_care: Flags,
    predictor: Predictor,
    likelihood: Likelihood,
    rng: np.random.Generator,
    particles: int,
    settles: bool = True,
) -> list[Particles]:
    """Evidence and particles of several sets of attachments.

    Args:
        peaks: Points of each that explain readings well, the best first, shape (g, p, size).
        free: What is integrated over, lengths before parameters, of each.
        precision: Of these there, shape (g, p, d, d).
        by_care: Which parameters' spreads have a factor in common that is not known, shape (g, d).
        predictor: Computes readings.
        likelihood: Of the observations.
        rng: Draws the particles.
        particles: For each; even.
        settles: Whether they are moved on where they have arrived. Evidences gain nothing by it.
    """
    own = np.take_along_axis(peaks, free.columns[:, None], axis=2) / free.spreads[:, None]
    normal = free.normal
    if by_care.any():
        own, normal = np.pad(own, _ONE_MORE), np.append(normal, True)
        precision = np.pad(precision, (*_ONE_MORE, (0, 1)))
        precision[..., -1, -1] = 1.0
    return _Run(
        points=peaks[:, 0],
        free=free,
        start=_Start.around(own, precision, normal),
        by_care=by_care,
        predictor=predictor,
        likelihood=likelihood,
        rng=rng,
        count=particles,
    ).finished(settles=settles)


@dataclass(frozen=True, kw_only=True)
class _Normal:
    """A normal distribution for each of g sets, as wide as particles are.

    Attributes:
        mean: Shape (g, d).
        root: Of the covariance, shape (g, d, d).
        inverse: Of the root.
        slopes: How lengths depend on θ there, shape (g, theta, lengths).
    """

    mean: Array
    root: Array
    inverse: Array
    slopes: Array

    @classmethod
    def of(cls, x: Array, lengths: int) -> _Normal:
        """As wide as particles of shape (g, n, d); the fewer, the less they say of correlations."""
        _, count, size = x.shape
        away = x - x.mean(axis=1, keepdims=True)
        covariance = np.swapaxes(away, 1, 2) @ away / count
        variance = np.diagonal(covariance, axis1=1, axis2=2) + _LEAST
        covariance = count / (count + size) * covariance
        covariance[:, np.arange(size), np.arange(size)] = variance
        root = np.asarray(np.linalg.cholesky(covariance))
        theta, both = covariance[:, lengths:, lengths:], covariance[:, lengths:, :lengths]
        return cls(
            mean=x.mean(axis=1),
            root=root,
            inverse=np.asarray(np.linalg.inv(root)),
            slopes=np.asarray(np.linalg.solve(theta, both)),
        )

    def log_density(self, x: Array) -> Array:
        """Of points of the sets, shape (g, n, d) in, to a constant of each."""
        away = (x - self.mean[:, None]) @ np.swapaxes(self.inverse, 1, 2)
        density: Array = -0.5 * np.sum(away**2, axis=2)
        return density


@dataclass(kw_only=True)
class _Run:
    points: Array
    free: Free
    start: _Start
    by_care: Flags
    predictor: Predictor
    likelihood: Likelihood
    rng: np.random.Generator
    count: int

    def __post_init__(self) -> None:
        everyone = np.arange(len(self.points))
        self._ess = np.full(everyone.size, float(self.count))
        self._x = self.start.draw(self.count, self.rng)
        self._fits = self._fits_at(self._x, everyone)
        self._base = self.start.log_density(self._x, everyone)
        self._powers, self._log_evidence = np.zeros((2, everyone.size))

    def finished(self, *, settles: bool) -> list[Particles]:
        """Goes to the posterior."""
        everyone = np.arange(len(self.points))
        self._drawn_anew(everyone, np.where(self._fits > _NOWHERE, 0.0, _NOWHERE))
        for _ in range(_MOST_STEPS):
            going = np.flatnonzero(self._powers < 1)
            if not going.size:
                break
            self._go_on(going)
            for _ in range(_MOVES):
                self._move(going)
        for _ in range(_LAST if settles else 0):
            self._move(everyone)
        return [self._particles(group) for group in everyone.tolist()]

    def _particles(self, group: int) -> Particles:
        return Particles(
            log_evidence=float(self._log_evidence[group]),
            values=self._values(np.full(self.count, group), self._x[group]),
            fits=self._fits[group].copy(),
            ess=float(self._ess[group]),
        )

    def _fits_at(self, x: Array, groups: Columns) -> Array:
        """Log-likelihoods, shape (g, n)."""
        lengths = x[..., : self.start.lengths]
        inside = np.all((lengths >= 0) & (lengths <= 1), axis=2)
        which, _ = np.nonzero(inside)
        fits = np.full(inside.shape, _NOWHERE)
        values = self._values(groups[which], x[inside])
        fits[inside] = self.likelihood.integrated(
            self.likelihood.misfits_of(self.predictor, values)
        )
        return fits

    def _log_prior(self, x: Array) -> Array:
        return _log_normal(x[..., self.start.lengths :])

    def _values(self, groups: Columns, x: Array) -> Array:
        """Points of n groups, shape (n,), with what is integrated over, shape (n, d)."""
        values, spreads = self.points[groups].copy(), self.free.spreads[groups]
        if x.shape[1] > spreads.shape[1]:
            *_, away = x.T
            spreads = np.where(self.by_care[groups], np.exp(CARE * away)[:, None], 1.0) * spreads
        own = x[:, : spreads.shape[1]] * spreads
        np.put_along_axis(values, self.free.columns[groups], own, axis=1)
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
        self._log_evidence[groups] += logsumexp(logs, axis=1) - math.log(self.count)
        weights = np.exp(logs - logs.max(axis=1, keepdims=True))
        ends = np.cumsum(weights, axis=1)
        starts = (np.arange(self.count) + self.rng.random((groups.size, 1))) / self.count
        for group, row_ends, row_starts in zip(groups.tolist(), ends, starts, strict=True):
            rows = np.searchsorted(row_ends, row_starts * row_ends[-1], side="right")
            rows = self.rng.permutation(np.minimum(rows, self.count - 1))
            self._ess[group] = np.unique(rows).size
            for array in (self._x, self._fits, self._base):
                array[group] = array[group, rows]

    def _move(self, groups: Columns) -> None:
        """Moves both halves, each by what the other knows."""
        half = self.count // 2
        for own, other in (
            (slice(None, half), slice(half, None)),
            (slice(half, None), slice(None, half)),
        ):
            x, others = self._x[groups, own], self._x[groups, other]
            around = _Normal.of(others, self.start.lengths)
            shares = np.array(_KINDS if self.start.lengths < x.shape[2] else _KINDS[:-1])
            kind = self.rng.choice(shares.size, size=x.shape[:2], p=shares / shares.sum())
            proposed = np.choose(
                kind[..., None],
                [
                    self._along_differences(x, others),
                    self._towards(x, around),
                    self._theta_alone(x, around),
                ],
            )
            kept = np.choose(
                kind,
                [
                    0.0,
                    around.log_density(x) - around.log_density(proposed),
                    self._log_prior(x) - self._log_prior(proposed),
                ],
            )
            self._accept(groups, own, proposed, kept)

    def _accept(self, groups: Columns, own: slice, proposed: Array, kept: Array) -> None:
        """Takes proposals, of steps that keep a density with the logarithm of its ratio."""
        x, fits = self._x[groups, own], self._fits_at(proposed, groups)
        base = self.start.log_density(proposed, groups)
        powers = self._powers[groups, None]
        before = powers * (self._fits[groups, own] + self._log_prior(x))
        before += (1 - powers) * self._base[groups, own]
        after = powers * (fits + self._log_prior(proposed)) + (1 - powers) * base
        chances = after - before + kept
        taken = (fits > _NOWHERE) & (np.log(self.rng.random(chances.shape)) < chances)
        for array, new in ((self._x, proposed), (self._fits, fits), (self._base, base)):
            part = array[groups, own]
            part[taken] = new[taken]
            array[groups, own] = part

    def _along_differences(self, x: Array, others: Array) -> Array:
        """Differential evolution, now and then by a whole difference, from peak to peak."""
        groups, count, size = x.shape
        pairs = self.rng.integers(others.shape[1], size=(2, groups, count))
        each = np.arange(groups)[:, None]
        away = others[each, pairs[0]] - others[each, pairs[1]]
        chosen = self.rng.random((groups, count, size)) < self.rng.random((groups, count, 1))
        dimensions = np.maximum(chosen.sum(axis=2, keepdims=True), 1)
        pace = 2.38 / np.sqrt(2 * dimensions) * self.rng.uniform(0.3, 1.1, (groups, count, 1))
        pace = np.where(self.rng.random((groups, count, 1)) < 0.1, 1.0, pace)
        spread = _JITTER * self.rng.standard_normal((groups, count, size))
        moved: Array = x + np.where(chosen, pace * away + spread * others.std(axis=1)[:, None], 0.0)
        return moved

    def _towards(self, x: Array, around: _Normal) -> Array:
        """Leaves a normal distribution as it is."""
        pace = self._pace(x, _SHORTEST[0])
        drawn = self.rng.standard_normal(x.shape) @ np.swapaxes(around.root, 1, 2)
        middle = around.mean[:, None]
        moved: Array = middle + np.sqrt(1 - pace**2) * (x - middle) + pace * drawn
        return moved

    def _theta_alone(self, x: Array, around: _Normal) -> Array:
        """Leaves the prior of θ as it is; lengths follow (preconditioned Crank-Nicolson)."""
        theta, pace = x[..., self.start.lengths :], self._pace(x, _SHORTEST[1])
        chosen = self.rng.random(theta.shape) < self.rng.random((*x.shape[:2], 1))
        drawn = np.sqrt(1 - pace**2) * theta + pace * self.rng.standard_normal(theta.shape)
        moved = np.where(chosen, drawn, theta)
        lengths = x[..., : self.start.lengths] + (moved - theta) @ around.slopes
        return np.concatenate([lengths, moved], axis=2)

    def _pace(self, x: Array, shortest: float) -> Array:
        pace: Array = np.exp(self.rng.uniform(math.log(shortest), 0.0, (*x.shape[:2], 1)))
        return pace


def _log_normal(theta: Array) -> Array:
    """Logarithm of the standard normal density of what is in the last axis."""
    density: Array = -0.5 * np.sum(theta**2, axis=-1) - _LOG_ROOT * theta.shape[-1]
    return density


def _share(ratios: Array, powers: Array) -> Array:
    """Effective share of particles weighted by these powers of their ratios, shape (g,)."""
    logs = powers[:, None] * ratios
    weights = np.exp(logs - logs.max(axis=1, keepdims=True))
    shares: Array = weights.sum(axis=1) ** 2 / np.sum(weights**2, axis=1) / ratios.shape[1]
    return shares
