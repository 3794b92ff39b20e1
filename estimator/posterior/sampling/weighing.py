"""Evidences of sets of attachments and of deviations from what is stated, and samples by weight.

What is weighed are *hypotheses*: a set of attachments with small deviations alone (the narrow
components of the table of parameters), or with one large one besides (a wide component). Each has
an evidence (``tempering``); those of one set of attachments add up, times their priors. Where few
readings leave many sets of attachments, these are weighed with few particles each and without wide
components, unless no set explains the readings without one and these can tell attachments.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from operator import itemgetter
from typing import Final, NamedTuple

import numpy as np

from estimator.body.morphology import Array
from estimator.parameters.table import prior_probabilities
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import MEAN_LOSS
from estimator.posterior.model.sensor_data import SCALED
from estimator.posterior.model.special import softmax
from estimator.posterior.model.unknowns import Attachments, Columns, Predictor
from estimator.posterior.posterior import CauseShare, systematic
from estimator.posterior.sampling.integrals import Hypothesis, Integrals
from estimator.posterior.sampling.tempering import Particles

_MOST: Final = 64  # sets of attachments that are weighed; drawn at random if there are more
_SETS_AT_ONCE: Final = 32  # sets weighed before it is decided whether more are needed
_IN_ONE_BATCH: Final = 2048  # readings times particles of the hypotheses in one task
_ROWS: Final = 12  # rows of the table whose wide components are fitted in one task
_WEIGHED: Final = 10.0  # nats that a guess may lie below the best for a hypothesis to be weighed
_PROBABLE: Final = 6.5  # the same where a wide component makes no other body
_FEWEST: Final = 48  # particles of one hypothesis, at least
_FIRST: Final = 4  # a first weight has at most all particles divided by this,
_SHARED: Final = 2  # and all first weights together this many times all particles
_CLOSE: Final = 5.0  # nats below the best within which sets are weighed again
_FEW_SETS: Final = 6  # sets that are weighed again; if more are so close, none is
_STRAYS: Final = 3.0  # nats that a fit lacks beyond the expected loss by noise
_LEADERS: Final = 3  # sets that are screened for wide components where the best fit strays
_MOST_WIDE: Final = 12  # wide components of a set that are weighed, at most
_OTHER_SETS: Final = 24  # sets not screened that are weighed with the leading wide component
_WORTH_REFINING: Final = 5.0  # nats below the best weight within which rough weights are made finer
_EQUILIBRATED: Final = 16  # samples of one hypothesis from which on they are equilibrated
_IN_ONE_TASK: Final = 128  # samples that are equilibrated in one task
_RARE: Final = 4  # points of a wide component of which there would be fewer samples
_DRAWN_POINTS: Final = 32  # points of a set, with which the next search begins
_DRAWN_SETS: Final = 32  # sets at most, of which such points are kept
_INTERVAL: Final = (0.05, 0.5, 0.95)


class _Weight(NamedTuple):
    hypothesis: Hypothesis
    particles: Particles
    log: float


@dataclass(frozen=True, kw_only=True)
class WeighedModes:
    """The posterior over sets of attachments, deviations and lengths.

    Attributes:
        points: The best point of each of n sets, shape (n, size).
        shares: Share of the posterior that each set has, shape (n,); a set drawn at random among
            several has theirs, too.
        ess: Effective sample size of each, shape (n,).
        values: Equally likely points of the posterior, shape (samples, size).
        rare: Points with wide components that are hardly among ``values``, shape (r, size).
        rare_shares: Shares of the posterior that these points stand for, shape (r,).
        causes: Wide components by their share of the posterior, the most probable first.
        as_stated: Points of the best set without any deviations, shape (m, size); ``None``: not
            computed, or no deviations are open.
        draws: Points of each set, more spread out than its posterior.
    """

    points: Array
    shares: Array
    ess: Array
    values: Array
    rare: Array
    rare_shares: Array
    causes: tuple[CauseShare, ...]
    as_stated: Array | None
    draws: Sequence[Array]

    def drawn_of(self, rows: Sequence[int]) -> Array:
        """Points, from ``draws``, of the most probable sets among these rows, shape (n, size)."""
        likely = sorted(rows, key=lambda row: -self.shares[row])[:_DRAWN_SETS]
        return np.concatenate([self.points[:0], *(self.draws[row] for row in likely)])


class Weigher:
    """Weighs sets of attachments by all observations.

    Args:
        predictor: Computes readings, also under deviations.
        likelihood: Likelihood of the observations.
        rng: Seeds the tasks, and draws sets and samples.
        workers: Executor of tasks for some hypotheses each; its number of workers changes no
            result.
        particles: Largest number of particles of one hypothesis.
        causes: Points with one wide component each, by its row of the table, from which fits of
            that component start, too: those that were weighed before.
    """

    def __init__(
        self,
        predictor: Predictor,
        likelihood: Likelihood,
        rng: np.random.Generator,
        *,
        workers: Executor,
        particles: int,
        causes: Mapping[int, Array],
    ) -> None:
        self._predictor, self._likelihood, self._rng = predictor, likelihood, rng
        self._known_causes = causes
        self._workers, self._particles = workers, particles
        self._integrals = Integrals(predictor, likelihood)
        self._weights: list[_Weight] = []
        self._stated: _Weight | None = None  # of the best set without any deviations

    def weigh(self, points: Array, guesses: Array) -> None:
        """Weighs sets of attachments, the best of them with wide components, too.

        Args:
            points: The best point of each set, shape (n, size).
            guesses: Guesses of the logarithms of the sets' evidences, shape (n,).
        """
        rows, log_chances = drawn(guesses, self._rng)
        points = self._predictor.unknowns.as_built(points[rows])
        log_none = math.log(prior_probabilities(self._predictor.unknowns.table)[-1])
        sets = [
            Hypothesis(point, log_prior=log_none, log_chance=chance)
            for point, chance in zip(points, log_chances.tolist(), strict=True)
        ]
        hoped = guesses[rows] - log_chances
        probable = int(np.count_nonzero(hoped >= hoped.max() - _WEIGHED))
        alone = len(sets) == 1  # weighed with all particles at once, and not again
        particles = min(_SHARED * self._particles // probable, self._particles // _FIRST)
        particles = self._particles if alone else max(particles, _FEWEST)
        weights, best = self._weights, -math.inf
        while len(weights) < len(sets) and hoped[len(weights)] >= best - _WEIGHED:
            batch = sets[len(weights) : len(weights) + _SETS_AT_ONCE]
            weights += self._of(batch, particles, several_peaks=alone)
            best = max(weight.log for weight in weights)
        self._weigh_again()

    @property
    def best(self) -> Array:
        """The best point of the most probable hypothesis, shape (size,)."""
        return max(self._weights, key=lambda one: one.log).particles.best

    @property
    def causes(self) -> dict[int, Array]:
        """The best point with each wide component that was weighed, by its row of the table."""
        by_log = sorted(self._weights, key=lambda one: one.log)
        return {
            weight.hypothesis.wide: weight.hypothesis.point
            for weight in by_log
            if weight.hypothesis.wide >= 0
        }

    def weigh_causes(self, points: Array) -> None:
        """Weighs points with one wide component each, too, shape (n, size), if they fit well."""
        unknowns, likelihood = self._predictor.unknowns, self._likelihood
        wide = np.argmax(points[:, unknowns.genes_size :], axis=1)
        logs = np.log(prior_probabilities(unknowns.table)[wide])
        fits = likelihood.integrated(likelihood.misfits_of(self._predictor, points)) + logs
        least = max([*fits, *(weight.particles.fits.max() for weight in self._weights)]) - _WEIGHED
        by_point = zip(points, wide.tolist(), logs.tolist(), strict=True)
        causes = [Hypothesis(point, wide=row, log_prior=log) for point, row, log in by_point]
        self._add_wide([cause for cause, fit in zip(causes, fits, strict=True) if fit > least])

    def _weigh_again(self) -> None:
        """Replaces weights of the best sets by finer ones, and adds those of wide components.

        Where many sets are close to the best only wide components are added, and only where
        readings can tell attachments and no set explains them without one: else a poor fit says
        only how well was searched.
        """
        weights = self._weights
        order = sorted(range(len(weights)), key=lambda row: -weights[row].log)
        close = [row for row in order if weights[row].log > weights[order[0]].log - _CLOSE]
        are_few, unknowns = len(close) <= _FEW_SETS, self._predictor.unknowns
        tells = unknowns.table and len(self._likelihood) >= unknowns.telling
        if not are_few and not (tells and self._strays([weights[row] for row in close])):
            return
        refined = close if are_few and len(weights) > 1 else []
        hypotheses = [weights[row].hypothesis for row in refined]
        if unknowns.table:
            point = weights[close[0]].hypothesis.point
            stated = unknowns.as_stated(unknowns.cube(point[None]))[0]
            hypotheses.append(Hypothesis(stated, as_stated=True))
        finer = self._of(hypotheses, self._particles)
        for row, weight in zip(refined, finer[: len(refined)], strict=True):
            weights[row] = weight
        if unknowns.table:
            self._stated = finer[-1]
            strays = self._strays([weights[row] for row in refined] or weights)
            self._add_wide(self._screened(close, strays=strays))

    def _add_wide(self, causes: Sequence[Hypothesis]) -> None:
        """Adds weights of hypotheses with wide components, finer ones where these are probable."""
        weights = self._weights
        known = {(weight.hypothesis.wide, *self._key(weight.hypothesis)) for weight in weights}
        by_key = {(cause.wide, *self._key(cause)): cause for cause in causes}
        rough = self._of([cause for key, cause in by_key.items() if key not in known], _FEWEST)
        leader = max([*weights, *rough], key=lambda one: one.log).hypothesis
        if leader.wide >= 0:
            others = self._others_with(leader, [*weights, *rough])
            rough += self._of(others, _FEWEST, several_peaks=False)
        rough.sort(key=lambda one: -one.log)
        best = max(weight.log for weight in [*rough, *weights])
        # Where one leads others may be as probable, or other sets with it.
        least = best - (_WEIGHED if leader.wide >= 0 else _WORTH_REFINING)
        probable = [weight.hypothesis for weight in rough if weight.log > least][:_MOST_WIDE]
        weights += self._of(probable, self._particles) + rough[len(probable) :]

    def _others_with(self, leader: Hypothesis, weights: Sequence[_Weight]) -> list[Hypothesis]:
        """Hypotheses of sets that were not screened, with the wide component of the leading one.

        Under that deviation other sets may explain the readings than without it.
        """
        best_first = [weight.hypothesis for weight in sorted(weights, key=lambda one: -one.log)]
        known = {self._key(one) for one in best_first if one.wide == leader.wide}
        choices = self._predictor.unknowns.choices
        others: list[Hypothesis] = []
        for hypothesis in best_first:
            if self._key(hypothesis) not in known and len(others) < _OTHER_SETS:
                known.add(self._key(hypothesis))
                point = leader.point.copy()
                point[choices] = hypothesis.point[choices]
                others.append(leader._replace(point=point, log_chance=hypothesis.log_chance))
        return others

    def _key(self, one: Hypothesis) -> Attachments:
        """Set of attachments of a hypothesis."""
        return self._predictor.unknowns.keys(one.point[None])[0]

    def _strays(self, weights: Sequence[_Weight]) -> bool:
        """Whether the best fit of these lies farther from the readings than noise explains."""
        readings = sum(self._likelihood.data.observed[name].count.sum() for name in SCALED)
        fit = max(float(weight.particles.fits.max()) for weight in weights)
        return float(self._likelihood.best().sum()) - fit - MEAN_LOSS * float(readings) >= _STRAYS

    def _screened(self, close: Sequence[int], *, strays: bool) -> list[Hypothesis]:
        """Hypotheses worth weighing, of the best sets with a wide component, best last.

        Improbable ones are, too, if they make another body, which a movement may test, and where
        the best fit strays or a wide component leads: there guesses may be several nats too low.
        """
        weights, rows = self._weights, [close[0], 0]  # the best, also as first guessed
        if strays:
            rows += [*close[:_LEADERS], *range(min(_LEADERS, len(weights)))]
        narrow = [weights[row] for row in dict.fromkeys(rows)]
        guessed = sorted((pair for one in narrow for pair in self._guessed(one)), key=itemgetter(0))
        best, leader = guessed[-1]
        points = np.array([hypothesis.point for _, hypothesis in guessed])
        known = max(narrow, key=lambda one: one.log).particles.values
        counts = self._predictor.unknowns.differ(points, known) | strays | (leader.wide >= 0)
        least = (best - np.where(counts, _WEIGHED, _PROBABLE)).tolist()
        promising = [one for (guess, one), low in zip(guessed, least, strict=True) if guess > low]
        return [one for one in promising if one.wide >= 0]

    def _guessed(self, narrow: _Weight) -> list[tuple[float, Hypothesis]]:
        """Guessed weights of a set: without wide components, and with each of the best ones."""
        unknowns, table = self._predictor.unknowns, self._predictor.unknowns.table
        priors = prior_probabilities(table)
        plain, point, best = narrow.hypothesis, narrow.hypothesis.point, narrow.particles.best
        batches = [[-1]]
        for switch in (True, False):
            rows = [n for n, row in enumerate(table) if row.switch == switch and row.may_deviate]
            batches += [rows[start : start + _ROWS] for start in range(0, len(rows), _ROWS)]
        seeds = self._rng.integers(2**32, size=len(batches)).tolist()
        # Also as stated: small deviations may stand in for a large one.
        starts = np.vstack([unknowns.as_stated(unknowns.cube(point[None])), best, point])
        known = self._known_causes
        tasks = [(rows, starts, known, seed) for rows, seed in zip(batches, seeds, strict=True)]
        fitted = []
        for results, cost in self._workers.map(self._integrals.fitted_with_cost, tasks):
            self._predictor.add_cost(cost)
            fitted += results
        (guess, _, _), *fitted = fitted
        fitted.sort(key=lambda one: -one[0])  # whatever their priors: a movement may test them
        rows = list(dict.fromkeys(row for _, row, _ in fitted))[:_MOST_WIDE]
        logs = {row: math.log(priors[row]) for row in rows}
        return [(guess, plain)] + [
            (evidence + logs[row], plain._replace(point=better, wide=row, log_prior=logs[row]))
            for evidence, row, better in fitted
            if row in logs
        ]

    def _of(
        self, hypotheses: Sequence[Hypothesis], particles: int, *, several_peaks: bool = True
    ) -> list[_Weight]:
        """Weights of hypotheses, with their points replaced by better ones.

        Hypotheses without deviations, which have fewer dimensions, have half as many particles.
        ``several_peaks``: whether particles start around more than one peak.
        """
        groups: dict[int, list[int]] = {}
        for number, hypothesis in enumerate(hypotheses):
            groups.setdefault(len(self._integrals.opened(hypothesis)), []).append(number)
        batch_size = max(1, _IN_ONE_BATCH // (particles * len(self._likelihood)))
        batches = [
            numbers[start : start + batch_size]
            for numbers in groups.values()
            for start in range(0, len(numbers), batch_size)
        ]
        seeds = self._rng.integers(2**32, size=len(batches)).tolist()
        tasks = []
        for batch, seed in zip(batches, seeds, strict=True):
            members = [hypotheses[number] for number in batch]
            count = particles // 2 if members[0].as_stated else particles
            tasks.append((members, count, several_peaks, seed))
        weights: dict[int, _Weight] = {}
        done = self._workers.map(self._integrals.with_cost, tasks)
        for batch, (results, cost) in zip(batches, done, strict=True):
            self._predictor.add_cost(cost)
            for number, (hypothesis, result) in zip(batch, results, strict=True):
                log = result.log_evidence + hypothesis.log_prior - hypothesis.log_chance
                log += float(self._predictor.unknowns.log_prior(hypothesis.point[None])[0])
                weights[number] = _Weight(hypothesis, result, log)
        return [weights[number] for number in range(len(hypotheses))]

    def summed(self, samples: int) -> WeighedModes:
        """The posterior over sets of attachments, deviations and lengths, with so many samples."""
        weights, stated = self._weights, self._stated
        keys = [self._key(weight.hypothesis) for weight in weights]
        sets = {key: number for number, key in enumerate(dict.fromkeys(keys))}
        mode = np.array([sets[key] for key in keys])
        shares = softmax(np.array([weight.log for weight in weights]))
        rare = (shares * samples < _RARE) & [weight.hypothesis.wide >= 0 for weight in weights]
        rows = systematic(np.where(rare, 0.0, shares), samples, float(self._rng.random()))
        counts = np.bincount(rows, minlength=len(weights)).tolist()
        counted = [pair for pair in zip(weights, counts, strict=True) if pair[1]]
        if stated:
            counted.append((stated, len(stated.particles.own)))
        values = self._equilibrated(counted)
        as_stated = values.pop() if stated else None
        draws, points = [], []
        for row in range(len(sets)):
            chosen = max(np.flatnonzero(mode == row).tolist(), key=lambda number: shares[number])
            particles = weights[chosen].particles
            draws.append(self._spread_out(particles.values))
            points.append(particles.best)
        rare_values = [weights[row].particles.values for row in np.flatnonzero(rare).tolist()]
        rare_values = [chosen[:: len(chosen) // _RARE][:_RARE] for chosen in rare_values]
        ess = np.array([weight.particles.ess for weight in weights])
        return WeighedModes(
            points=np.array(points),
            shares=np.bincount(mode, shares).astype(float),
            ess=np.bincount(mode, np.where(shares > 0, ess, 0.0)).astype(float),
            values=np.concatenate(values),
            rare=np.concatenate([values[0][:0], *rare_values]),
            rare_shares=np.repeat(shares[rare] / _RARE, _RARE),
            causes=self._cause_shares(weights, shares),
            as_stated=as_stated,
            draws=draws,
        )

    def _equilibrated(self, drawn: Sequence[tuple[_Weight, int]]) -> list[Array]:
        """So many points of each hypothesis, shape (count, size), equilibrated where many."""
        values, tasks, places = [], [], []
        for number, (weight, count) in enumerate(drawn):
            rows = np.resize(self._rng.permutation(len(weight.particles.own)), count)
            values.append(weight.particles.values[rows])
            for start in range(0, len(rows) if count >= _EQUILIBRATED else 0, _IN_ONE_TASK):
                batch = rows[start : start + _IN_ONE_TASK]
                seed = int(self._rng.integers(2**32))
                tasks.append((weight.hypothesis, weight.particles.own[batch], seed))
                places.append((number, slice(start, start + len(batch))))
        done = self._workers.map(self._integrals.equilibrated_with_cost, tasks)
        for (number, place), (equilibrated, cost) in zip(places, done, strict=True):
            values[number][place] = equilibrated
            self._predictor.add_cost(cost)
        return values

    def _spread_out(self, values: Array) -> Array:
        """Some particles, in half of which the least known length is drawn from its prior.

        The next reading may make lengths probable that hardly are so far.
        """
        drawn = values[self._rng.integers(len(values), size=_DRAWN_POINTS)].copy()
        lengths = self._predictor.unknowns.continuous
        if lengths.size:
            column = lengths[int(np.argmax(values[:, lengths].std(axis=0)))]
            drawn[::2, column] = self._rng.random(len(drawn[::2]))
        return drawn

    def _cause_shares(self, weights: Sequence[_Weight], shares: Array) -> tuple[CauseShare, ...]:
        unknowns, causes = self._predictor.unknowns, []
        wide = np.array([weight.hypothesis.wide for weight in weights])
        for row in sorted(set(wide[wide >= 0].tolist())):
            rows = np.flatnonzero(wide == row)
            values = weights[rows[np.argmax(shares[rows])]].particles.values
            low, median, high = np.quantile(values[:, unknowns.genes_size + row], _INTERVAL)
            share = min(1.0, float(shares[rows].sum()))
            causes.append(CauseShare(row, share, float(low), float(median), float(high)))
        return tuple(sorted(causes, key=lambda cause: -cause.probability))


def drawn(guesses: Array, rng: np.random.Generator) -> tuple[Columns, Array]:
    """Some of the modes, ``_MOST`` at most, drawn by their guessed shares.

    Modes with a large share are always taken, the others by systematic sampling. Evidences divided
    by the chances are unbiased.

    Returns:
        Indices of the modes, best guess first, and the logarithms of their chances.
    """
    order = np.argsort(-guesses, kind="stable")
    if len(order) <= _MOST:
        return order, np.zeros(len(order))
    shares = softmax(guesses[order])
    remaining = np.cumsum(shares[::-1])[::-1]
    sure = 0
    while shares[sure] * (_MOST - sure) >= remaining[sure]:
        sure += 1
    chances = np.ones(len(order))
    chances[sure:] = shares[sure:] / remaining[sure] * (_MOST - sure)
    ends = np.floor(np.cumsum(chances) + rng.random())
    taken = np.flatnonzero(np.diff(ends, prepend=0.0) > 0)
    return order[taken], np.log(chances[taken])
