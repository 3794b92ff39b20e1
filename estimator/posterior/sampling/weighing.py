"""Sets of attachments weighed, with all that may be otherwise than stated, and samples by weight.

What is weighed are *hypotheses*: a set of attachments on a robot as people build them (the narrow
components of the table of parameters, all spreads times a common factor), or with one wide
component, which makes it otherwise than stated. Each has an evidence (``tempering``); those of one
set of attachments add up, times their priors. The common factor is averaged over: how carefully a
robot was built is not known. Where few readings leave many sets of attachments, the narrow
components alone are open, with as many particles for each set as there are for all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from estimator.body.morphology import Array
from estimator.parameters.table import DEVIATES, log_priors
from estimator.posterior.model.gauss_newton import Free, GaussNewton
from estimator.posterior.model.likelihood import Likelihood, Noise
from estimator.posterior.model.noise import MEAN_LOSS
from estimator.posterior.model.sensor_data import SCALED, SensorData
from estimator.posterior.model.special import logsumexp, softmax
from estimator.posterior.model.unknowns import Columns, Cost, Predictor
from estimator.posterior.posterior import CauseShare, Posterior, systematic
from estimator.posterior.sampling.tempering import Particles, tempered

_MOST: Final = 120  # sets of attachments that are weighed, drawn if there are more
_AT_ONCE: Final = 8  # of them, by one worker
_WEIGHED: Final = 9.0  # nats below the best evidence
_FEWEST: Final = 48  # particles of each at first,
_FIRST: Final = 4  # or this part of all at most,
_SHARED: Final = 2  # where so many times as many as one may have are shared among them
_SCALES: Final = {2.0: 0.4, 1.0: 0.4, 0.5: 0.2}  # of the spreads, and their probabilities
_CLOSE: Final = 5.0  # nats below the best, sets that are weighed again under each,
_FEW: Final = 6  # if no more are so close
_STRAYS: Final = 3.0  # nats that a fit lacks beyond what noise takes
_LEADERS: Final = 3  # sets that are looked at with wide components where the best lacks so much
_WORTH: Final = 5.0  # nats below the best without any, wide ones that are sampled
_WIDE: Final = 6  # of them
_OFF: Final = 1.5  # standard deviations from which fits start
_ANYWHERE: Final = 100  # lengths at random with each wide component: what is wrong bends lengths,
_STARTS: Final = 3  # of them, where fits start
_PEAKS: Final = 3  # of these fits, where particles start,
_LOWER: Final = 10.0  # but none so many nats below the best
_STRETCHED: Final = ("thickness", "mass")  # groups of the parameters that these starts have
_DRAWN: Final = 32  # points of a set, for the next interaction,
_DRAWN_OF: Final = 32  # of so many sets
_INTERVAL: Final = (0.05, 0.5, 0.95)


class Hypothesis(NamedTuple):
    """What is open beside the lengths of one set of attachments.

    Attributes:
        mode: Number of the set.
        point: To start from, shape (size,).
        wide: Row of the table whose wide component is open; −1: none is.
        scale: Factor on the narrow spreads; 0: the robot is as stated.
        log_prior: Among the hypotheses of the set.
    """

    mode: int
    point: Array
    wide: int = -1
    scale: float = 1.0
    log_prior: float = 0.0


class _Weight(NamedTuple):
    hypothesis: Hypothesis
    particles: Particles
    log: float


@dataclass(frozen=True, kw_only=True)
class WeighedModes:
    """Sets of attachments that stand for all that were discovered.

    Attributes:
        points: The point of each that fits best, shape (n, size).
        shares: Of the posterior, shape (n,); one that was drawn among several stands for them.
        ess: Effective number of particles of each, shape (n,).
        values: Equally likely points of the posterior, shape (samples, size).
        causes: Wide components by their share of the posterior, the most probable first.
        as_stated: Points of the first set if the robot is just as stated, shape (m, size);
            ``None``: not known, or all are.
        draws: Points of each set, more spread out than its posterior.
    """

    points: Array
    shares: Array
    ess: Array
    values: Array
    causes: tuple[CauseShare, ...]
    as_stated: Array | None
    draws: Sequence[Array]

    def drawn_of(self, rows: Sequence[int]) -> Array:
        """Some particles of the most probable of the sets of these rows, shape (n, size)."""
        likely = sorted(rows, key=lambda row: -self.shares[row])[:_DRAWN_OF]
        return np.concatenate([self.points[:0], *(self.draws[row] for row in likely)])


class Weigher:
    """Weighs sets of attachments by all observations.

    Args:
        predictor: Computes readings, also of robots that are not as stated.
        data: The observations.
        noise: Sensor noise.
        rng: Draws.
        workers: Do the work of some hypotheses each; how many there are changes no result.
        particles: Of one hypothesis, at most; even.
    """

    def __init__(
        self,
        predictor: Predictor,
        data: SensorData,
        noise: Noise,
        rng: np.random.Generator,
        *,
        workers: Executor,
        particles: int,
    ) -> None:
        self._predictor, self._data, self._rng = predictor, data, rng
        self._workers, self._particles = workers, particles
        self._likelihood = Likelihood(data, noise)
        self._integrals = _Integrals(predictor, data, self._likelihood)

    def weighed(self, points: Array, guesses: Array, samples: int) -> WeighedModes:
        """The posterior over sets of attachments, and over what else is open.

        Args:
            points: The best of each set, shape (n, size).
            guesses: Of their evidences, shape (n,).
            samples: How many points are drawn of the posterior.
        """
        rows, log_chances = drawn(guesses, self._rng)
        points = self._predictor.unknowns.as_built(points[rows])
        hoped = guesses[rows] - log_chances
        near = int(np.count_nonzero(hoped >= hoped.max() - _WEIGHED))
        each = min(_SHARED * self._particles // near, self._particles // _FIRST)
        weights: list[_Weight] = []
        best = -math.inf
        while len(weights) < len(rows) and hoped[len(weights)] >= best - _WEIGHED:
            few = range(len(weights), min(len(weights) + 2 * _AT_ONCE, len(rows)))
            first = [Hypothesis(row, points[row]) for row in few]
            weights += self._of(first, max(each, _FEWEST), log_chances, settles=False)
            best = max(one.log for one in weights)
        points = np.array([one.hypothesis.point for one in weights])
        close = _close(weights)
        as_stated: Array | None = None
        if len(close) <= _FEW:
            as_stated = self._weighed_again(weights, close, log_chances)
        return self._summed(points, weights, as_stated, samples)

    def _weighed_again(
        self, weights: list[_Weight], close: Sequence[int], log_chances: Array
    ) -> Array | None:
        """Replaces weights of some sets by those under each scale, and of wide components.

        Returns:
            Points of the first one if the robot is just as stated, where it may be otherwise.
        """
        if not self._predictor.unknowns.table:
            hypotheses = [weights[row].hypothesis for row in close]
            again = self._of(hypotheses, self._particles, log_chances)
            for row, one in zip(close, again, strict=True):
                weights[row] = one
            return None
        mode, point, *_ = weights[close[0]].hypothesis
        unknowns = self._predictor.unknowns
        exact = Hypothesis(mode, unknowns.as_stated(unknowns.cube(point[None]))[0], scale=0.0)
        (stated,) = self._of([exact], self._particles // 2, log_chances)
        narrow = [
            weights[row].hypothesis._replace(
                scale=scale, log_prior=math.log(share * (1 - DEVIATES))
            )
            for row in close
            for scale, share in _SCALES.items()
        ]
        again = self._of(narrow, self._particles, log_chances)
        first = [close[0], 0]  # the best, also as first guessed
        if self._strays(max(float(one.particles.fits.max()) for one in again)):
            first += [*close[:_LEADERS], *range(min(_LEADERS, len(weights)))]
        screened = [
            self._screened([one for one in again if one.hypothesis.mode == row] or [weights[row]])
            for row in dict.fromkeys(first)
        ]
        least = max(guess for guess, _ in screened) - _WORTH
        for _, wide in screened:
            again += self._of(
                [one for guess, one in wide if guess > least], self._particles, log_chances
            )
        for row in close:
            weights[row] = weights[row]._replace(log=-math.inf)
        weights += again
        return stated.particles.values

    def _strays(self, fit: float) -> bool:
        """Whether the best fit lacks more than noise takes."""
        read = sum(self._data.observed[name].known.count.sum() for name in SCALED)
        best = float(self._likelihood.best().sum())
        return best - fit - MEAN_LOSS * float(read) >= _STRAYS

    def _screened(
        self, narrow: Sequence[_Weight]
    ) -> tuple[float, Sequence[tuple[float, Hypothesis]]]:
        """Guessed evidences of a set: of its narrow components, and of the best with wide ones."""
        leader = max(narrow, key=lambda one: one.log)
        mode, point, *_ = leader.hypothesis
        known = leader.particles.values[int(np.argmax(leader.particles.fits))]
        table = self._predictor.unknowns.table
        priors = log_priors(table)
        guess, fitted = self._integrals.fitted_wide(np.vstack([known, point]), self._rng)
        wide = []
        for of_row, row, stated in fitted:
            prior = priors[table[row].name]
            wide.append((of_row + prior, Hypothesis(mode, stated, wide=row, log_prior=prior)))
        wide.sort(key=lambda one: -one[0])
        return guess, wide[:_WIDE]

    def _of(
        self,
        hypotheses: Sequence[Hypothesis],
        particles: int,
        log_chances: Array,
        *,
        settles: bool = True,
    ) -> list[_Weight]:
        """Weights of hypotheses, which begin at better points than they had."""
        groups: dict[int, list[int]] = {}
        for number, one in enumerate(hypotheses):
            groups.setdefault(len(self._integrals.columns(one)), []).append(number)
        batches = [
            numbers[start : start + _AT_ONCE]
            for numbers in groups.values()
            for start in range(0, len(numbers), _AT_ONCE)
        ]
        seeds = self._rng.integers(2**32, size=len(batches)).tolist()
        tasks = [
            ([hypotheses[number] for number in batch], _even(particles), settles, seed)
            for batch, seed in zip(batches, seeds, strict=True)
        ]
        weights: dict[int, _Weight] = {}
        done = self._workers.map(self._integrals.with_cost, tasks)
        for batch, (results, cost) in zip(batches, done, strict=True):
            self._predictor.add_cost(cost)
            for number, (one, result) in zip(batch, results, strict=True):
                log = result.log_evidence + one.log_prior - float(log_chances[one.mode])
                log += float(self._predictor.unknowns.log_prior(one.point[None])[0])
                weights[number] = _Weight(one, result, log)
        return [weights[number] for number in range(len(hypotheses))]

    def _summed(
        self, points: Array, weights: Sequence[_Weight], as_stated: Array | None, samples: int
    ) -> WeighedModes:
        mode = np.array([one.hypothesis.mode for one in weights])
        shares = softmax(np.array([one.log for one in weights]))
        values = []
        rows = systematic(shares, samples, float(self._rng.random()))
        for number, one in enumerate(weights):
            wanted = int(np.count_nonzero(rows == number))
            order = self._rng.permutation(len(one.particles.values))
            values.append(one.particles.values[np.resize(order, wanted)])
        draws, points = [], points.copy()
        for row in range(len(points)):
            own = max(np.flatnonzero(mode == row).tolist(), key=lambda number: shares[number])
            particles = weights[own].particles
            draws.append(self._spread_out(particles.values))
            points[row] = particles.values[int(np.argmax(particles.fits))]
        behind = np.array([one.particles.ess for one in weights])
        return WeighedModes(
            points=points,
            shares=np.bincount(mode, shares, len(points)).astype(float),
            ess=np.bincount(mode, np.where(shares > 0, behind, 0.0), len(points)).astype(float),
            values=np.concatenate(values),
            causes=self._causes(weights, shares),
            as_stated=as_stated,
            draws=draws,
        )

    def _spread_out(self, values: Array) -> Array:
        """Some particles, half of them with the least known length anywhere.

        The next reading may make probable what hardly is by now.
        """
        drawn = values[self._rng.integers(len(values), size=_DRAWN)].copy()
        lengths = self._predictor.unknowns.continuous
        if lengths.size:
            column = lengths[int(np.argmax(values[:, lengths].std(axis=0)))]
            drawn[::2, column] = self._rng.random(len(drawn[::2]))
        return drawn

    def _causes(self, weights: Sequence[_Weight], shares: Array) -> tuple[CauseShare, ...]:
        unknowns, causes = self._predictor.unknowns, []
        wide = np.array([one.hypothesis.wide for one in weights])
        for row in sorted(set(wide[wide >= 0].tolist())):
            own = np.flatnonzero(wide == row)
            first = weights[own[np.argmax(shares[own])]].particles.values
            low, median, high = np.quantile(first[:, unknowns.genes_size + row], _INTERVAL)
            share = min(1.0, float(shares[own].sum()))
            causes.append(CauseShare(row, share, float(low), float(median), float(high)))
        return tuple(sorted(causes, key=lambda cause: -cause.probability))


class _Integrals:
    """Evidence and particles of hypotheses; travels to worker processes.

    Args:
        predictor: Computes readings.
        data: The observations.
        likelihood: Of these.
    """

    def __init__(self, predictor: Predictor, data: SensorData, likelihood: Likelihood) -> None:
        self._predictor, self._likelihood = predictor, likelihood
        self._solver = GaussNewton(predictor, data, likelihood)
        self._lengths = predictor.unknowns.continuous
        table = predictor.unknowns.table
        self._first = predictor.unknowns.genes_size
        self._narrow = [row for row, one in enumerate(table) if one.narrow]
        self._interactions = np.arange(len(data))

    def with_cost(
        self, task: tuple[Sequence[Hypothesis], int, bool, int]
    ) -> tuple[list[tuple[Hypothesis, Particles]], Cost]:
        """Hypotheses that have as many columns, at the points that fit best, and what that cost.

        Args:
            task: These, how many particles of each, whether they settle, and a seed.
        """
        hypotheses, particles, settles, seed = task
        before = self._predictor.cost
        free, points = self._free(hypotheses), np.array([one.point for one in hypotheses])
        peaks = self._peaks(points, hypotheses, free, several=settles)
        count, each, size = peaks.shape
        which = np.repeat(np.arange(count), each)
        slopes = self._solver.slopes(peaks.reshape(-1, size), free=free[which])
        results = tempered(
            peaks,
            free,
            slopes.precision.reshape(count, each, *slopes.precision.shape[1:]),
            predictor=self._predictor,
            likelihood=self._likelihood,
            rng=np.random.default_rng(seed),
            particles=particles,
            settles=settles,
        )
        better = (one._replace(point=own[0]) for one, own in zip(hypotheses, peaks, strict=True))
        return list(zip(better, results, strict=True)), self._predictor.cost.since(before)

    def columns(self, one: Hypothesis) -> list[int]:
        """Columns of what is open, lengths first."""
        rows = self._narrow if one.scale else []
        table = self._predictor.unknowns.table
        if one.wide >= 0 and not table[one.wide].switch and one.wide not in rows:
            rows = [*rows, one.wide]
        return [*self._lengths.tolist(), *(self._first + row for row in rows)]

    def _free(self, hypotheses: Sequence[Hypothesis]) -> Free:
        columns = np.array([self.columns(one) for one in hypotheses], dtype=np.intp)
        spreads = [
            [
                1.0 if column < self._first else self._spread(one, column - self._first)
                for column in own
            ]
            for one, own in zip(hypotheses, columns.tolist(), strict=True)
        ]
        normal = columns[0] >= self._first
        return Free(columns=columns, spreads=np.array(spreads), normal=normal)

    def _spread(self, one: Hypothesis, row: int) -> float:
        parameter = self._predictor.unknowns.table[row]
        return parameter.wide if row == one.wide else one.scale * parameter.narrow

    def _peaks(
        self, points: Array, hypotheses: Sequence[Hypothesis], free: Free, *, several: bool
    ) -> Array:
        """The best point from each, or a few, from robots that are thicker, thinner, and so on.

        Returns:
            Shape (n, peaks, size), the best first.
        """
        starts = [points]
        rows = [
            row
            for row, parameter in enumerate(self._predictor.unknowns.table)
            if parameter.group in _STRETCHED and self._first + row in free.columns[0]
        ]
        for row in rows if several else ():
            spreads = np.array([self._spread(one, row) for one in hypotheses])
            for sign in (-_OFF, _OFF):
                moved = points.copy()
                moved[:, self._first + row] = sign * spreads
                starts.append(moved)
        each = np.arange(len(points))
        polished, fits = self._solver.polished(
            np.vstack(starts), free=free[np.tile(each, len(starts))]
        )
        by_start = polished.reshape(len(starts), len(points), -1)
        fits = fits.reshape(len(starts), -1)
        order = np.argsort(-fits, axis=0, kind="stable")[:_PEAKS]
        order = np.where(fits[order, each] < fits[order[0], each] - _LOWER, order[0], order)
        return np.swapaxes(by_start[order, each], 0, 1)

    def fitted_wide(
        self, starts: Array, rng: np.random.Generator
    ) -> tuple[float, list[tuple[float, int, Array]]]:
        """Points that fit best with each wide component, where lengths alone are free with it.

        Args:
            starts: Of one set of attachments, shape (n, size).
            rng: Draws other lengths to start from.

        Returns:
            Laplace's approximation of the evidence without any, and for each wide component that,
            its row of the table, and the point.
        """
        table = self._predictor.unknowns.table
        kinds = (
            [-1],
            [row for row, one in enumerate(table) if one.switch],
            [row for row, one in enumerate(table) if one.wide and not one.switch],
        )
        (guess, _, _), *wide = [
            one for rows in kinds if rows for one in self._fitted_with(rows, starts, rng)
        ]
        return guess, wide

    def _fitted_with(
        self, rows: Sequence[int], starts: Array, rng: np.random.Generator
    ) -> list[tuple[float, int, Array]]:
        """The same with wide components of one kind, or −1, none."""
        table = self._predictor.unknowns.table
        sizes = np.array([table[row].wide or 1.0 for row in rows])
        amounts = not (rows[0] < 0 or table[rows[0]].switch)
        anywhere = np.repeat(starts[-1:], _ANYWHERE, axis=0)
        anywhere[:, self._lengths] = rng.random((_ANYWHERE, self._lengths.size))
        offs = rng.standard_normal(_ANYWHERE) if amounts else np.ones(_ANYWHERE)
        points, which = self._with_wide(anywhere, rows, offs[:, None] * sizes)
        fits = self._solver.rough_fits(points, self._interactions).sum(axis=1)
        first = np.argsort(-fits.reshape(_ANYWHERE, -1), axis=0, kind="stable")[:_STARTS]
        points = points.reshape(_ANYWHERE, len(rows), -1)[first, np.arange(len(rows))]
        several = [(points.reshape(-1, starts.shape[1]), np.tile(rows, _STARTS))]
        for sign in (-_OFF, _OFF) if amounts else (1.0,):
            signs = np.full((len(starts), 1), sign)
            several.append(self._with_wide(starts, rows, signs * sizes))
        points, which = (np.concatenate(arrays) for arrays in zip(*several, strict=True))
        free = Free.lengths(self._lengths, len(points))
        if amounts:
            own = np.array([table[row].wide for row in which.tolist()])
            free = Free(
                columns=np.column_stack([free.columns, self._first + which]),
                spreads=np.column_stack([free.spreads, own]),
                normal=np.append(free.normal, True),
            )
        polished, fits = self._solver.polished(points, free=free)
        fits += self._predictor.unknowns.log_narrow(polished, which)
        fitted = []
        for row in rows:
            own = np.flatnonzero(which == row)
            fitted.append(int(own[np.argmax(fits[own])]))
        chosen = np.array(fitted, dtype=np.intp)
        guesses = fits[chosen] + self._solver.half_volumes(polished[chosen], free[chosen])
        return list(zip(guesses.tolist(), rows, polished[chosen], strict=True))

    def _with_wide(
        self, points: Array, rows: Sequence[int], amounts: Array
    ) -> tuple[Array, Columns]:
        """Each of n points with each of these wide components alone, and which, shape (n · rows,).

        Args:
            points: Shape (n, size).
            rows: Of the table; −1: none.
            amounts: Of each, shape (n, rows).
        """
        which = np.tile(np.array(rows, dtype=np.intp), len(points))
        several = np.repeat(points, len(rows), axis=0)
        on = np.flatnonzero(which >= 0)
        several[on, self._first + which[on]] = amounts.ravel()[on]
        return several, which


def _close(weights: Sequence[_Weight]) -> list[int]:
    """Rows of the sets of attachments that are about as probable as the best, best first."""
    best = max(one.log for one in weights)
    rows = sorted(range(len(weights)), key=lambda row: -weights[row].log)
    return [row for row in rows if weights[row].log > best - _CLOSE]


def _even(count: int) -> int:
    return 2 * (count // 2)


def drawn(guesses: Array, rng: np.random.Generator) -> tuple[Columns, Array]:
    """Some of the modes, by their guessed shares: ``_MOST`` at most, which stand for all.

    Those with a large share are taken for sure, of the others each by its chance (systematic
    sampling); so no evidence is lost on average.

    Returns:
        Their indices, best guess first, and the logarithms of their chances.
    """
    order = np.argsort(-guesses, kind="stable")
    if len(order) <= _MOST:
        return order, np.zeros(len(order))
    shares = softmax(guesses[order])
    rest = np.cumsum(shares[::-1])[::-1]
    sure = 0
    while shares[sure] * (_MOST - sure) >= rest[sure]:
        sure += 1
    chances = np.ones(len(order))
    chances[sure:] = shares[sure:] / rest[sure] * (_MOST - sure)
    ends = np.floor(np.cumsum(chances) + rng.random())
    taken = np.flatnonzero(np.diff(ends, prepend=0.0) > 0)
    return order[taken], np.log(chances[taken])


def renormalised(posterior: Posterior, predictor: Predictor, likelihood: Likelihood) -> Posterior:
    """The posterior under densities that add up to 1, also where bodies may fall to several sides.

    Args:
        posterior: Equally likely samples, and modes, under a likelihood that adds up to more there.
        predictor: Computes readings.
        likelihood: That one.

    Returns:
        Equally likely samples, and modes, the most probable first.
    """

    def ratios(values: Array, scales: Array) -> Array:
        as_found = likelihood.of(likelihood.misfits_of(predictor, values), scales=scales)
        ratios: Array = (likelihood.normalised(predictor, values, scales) - as_found).sum(axis=1)
        return ratios

    modes, keys = posterior.modes, predictor.unknowns.keys(posterior.values)
    of_samples = ratios(posterior.values, posterior.scales)
    factors = ratios(np.array([mode.point for mode in modes]), np.zeros((len(modes), 2)))
    for number, mode in enumerate(modes):
        own = of_samples[[key == mode.attachments for key in keys]]
        if own.size:
            factors[number] = logsumexp(own) - math.log(own.size)
    shares = np.array([mode.probability for mode in modes]) * np.exp(factors - factors.max())
    rows = systematic(softmax(of_samples), len(keys), 0.5)
    changed = (
        replace(mode, probability=share)
        for mode, share in zip(modes, (shares / shares.sum()).tolist(), strict=True)
    )
    return replace(
        posterior,
        values=posterior.values[rows],
        scales=posterior.scales[rows],
        modes=tuple(sorted(changed, key=lambda mode: -mode.probability)),
    )
