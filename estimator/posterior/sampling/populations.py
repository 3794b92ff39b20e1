"""Agreement of independent populations of chains, and their exploration of many attachments.

Populations are independent, so what both have found tells how much neither has (capture and
recapture).

While the readings do not inform about all parts of many, the chains themselves are the samples of
the posterior (``explored``). Nearly every sample then has attachments of its own, and it would be
of no use to weigh them one by one. Most samples agree on the limb or two that the readings do
determine: by them the next program is chosen, and from them the chains go on.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, Self

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.checks.verdict import POOR, Fit, fit_of
from estimator.posterior.discovery.discovery import BestPoints, Discovery
from estimator.posterior.discovery.population import EVERY, Population
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.special import softmax
from estimator.posterior.model.unknowns import Attachments
from estimator.posterior.posterior import Mode, Posterior, coverage, found_by_each
from estimator.storage.posteriors import OUTLIERS

CONSIDERED: Final = 16.0
"""Nats below the best fit within which sets of attachments are considered."""

ENOUGH_TO_ERR: Final = 5
"""Number of interactions from which on one may be left unexplained."""

_FURTHER_NATS: Final = 14.0  # where no body within ``CONSIDERED`` explains the readings
_FITTED_SETS: Final = 120  # sets of attachments, at most, whose narrow components are fitted then
_AS_GOOD: Final = 3.0  # nats that a population's fit may lie below the best one of the same set
_AS_PROBABLE: Final = 3.0  # nats below the leader within which sets are about as probable
_BAD_EXCESS: Final = 2.33  # excess of a fit that one right body of a hundred has
_FEW_SETS: Final = 50  # effective number of sets up to which every population can have found all


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Agreement of the populations: the attachments that each has found, and how well they fit.

    Attributes:
        points: Best point of each set of attachments that may matter, best first, shape (n, size).
        keys: Attachments of these points.
        guesses: Guesses of the logarithms of their evidences, shape (n,).
        found: For each population, the attachments that it has found with a fit about as good.
        fit: How well the leader, the most probable set by those guesses, explains the readings.
        may_err: Whether there are so many readings that one may be left unexplained.
    """

    points: Array
    keys: list[Attachments]
    guesses: Array
    found: Sequence[Collection[Attachments]]
    fit: Fit
    may_err: bool

    @classmethod
    def of(cls, bodies: Sequence[BestPoints], deviations: Array, solver: GaussNewton) -> Self:
        """Compares what the populations have found.

        Args:
            bodies: The best points of each population.
            deviations: Deviations of all these bodies from what is stated, shape (rows,).
            solver: Approximates evidences.
        """
        predictor, likelihood = solver.predictor, solver.likelihood
        unknowns = predictor.unknowns
        joined = BestPoints.joined(bodies, unknowns)
        best = float(joined.fits[0])
        values = unknowns.with_deviations(joined.values, deviations)
        considered = values[joined.fits > best - CONSIDERED]
        points, guesses = considered, solver.evidences(considered)
        fit = fit_of(points[int(np.argmax(guesses))], predictor, likelihood)
        if unknowns.table and fit.is_improvable:
            considered = values[joined.fits > best - CONSIDERED - _FURTHER_NATS]
            points, guesses = considered.copy(), solver.evidences(considered)
            first = np.argsort(-guesses, kind="stable")[:_FITTED_SETS]
            points[first], guesses[first] = solver.evidences_as_built(considered[first])
            fit = fit_of(points[int(np.argmax(guesses))], predictor, likelihood)
        best_fits = dict(
            zip(unknowns.keys(considered), solver.fits(considered).tolist(), strict=True)
        )
        found = [
            attachments_found(unknowns.with_deviations(one.values, deviations), best_fits, solver)
            for one in bodies
        ]
        return cls(
            points=points,
            keys=unknowns.keys(points),
            guesses=guesses,
            found=found,
            fit=fit,
            may_err=len(likelihood) >= ENOUGH_TO_ERR,
        )

    def with_fit(self, fit: Fit) -> Self:
        """This agreement with the fit of another body, if that is better."""
        return replace(self, fit=min(self.fit, fit, key=lambda one: (one.unexplained, one.excess)))

    @property
    def leader(self) -> Attachments:
        """The most probable attachments."""
        return self.keys[int(np.argmax(self.guesses))]

    @property
    def leaders(self) -> list[Attachments]:
        """Attachments about as probable as the leader's, such as indistinguishable ones."""
        rows = np.flatnonzero(self.guesses > self.guesses.max() - _AS_PROBABLE)
        return [self.keys[row] for row in rows]

    @property
    def explained(self) -> bool:
        """Whether the leader leaves no more interactions unexplained than outliers may be."""
        return self.fit.unexplained <= OUTLIERS

    @property
    def explains_too_little(self) -> bool:
        """Whether the leader leaves more interactions unexplained than a right body may."""
        return self.fit.unexplained > (OUTLIERS if self.may_err else 0)

    @property
    def adequate_fit(self) -> bool:
        """Whether the readings are explained so well that a body can be probable.

        One interaction may be an outlier, but not where the others are explained poorly, too: two
        outliers lead to a body that explains all interactions, none of them well. Where attachments
        are known no other body can explain the readings better, so only a bad fit is inadequate.
        """
        any_other = bool(self.leader)
        outlier = self.fit.unexplained > 0
        limit = POOR if any_other and (outlier or not self.may_err) else _BAD_EXCESS
        return not self.explains_too_little and self.fit.excess <= limit

    @property
    def few(self) -> bool:
        """Whether so few sets of attachments matter that every population can have found all."""
        return bool(np.sum(softmax(self.guesses) ** 2) > 1 / _FEW_SETS)

    @property
    def coverage(self) -> float:
        """Share of the posterior that the populations have found."""
        return coverage(softmax(self.guesses), found_by_each(self.keys, self.found))

    def share_of(self, some: Collection[Attachments]) -> float:
        """Guessed share of the posterior that some attachments have."""
        shares = softmax(self.guesses)
        return float(sum(shares[row] for row, key in enumerate(self.keys) if key in some))


def attachments_found(
    values: Array, best_fits: Mapping[Attachments, float], solver: GaussNewton
) -> set[Attachments]:
    """Sets of attachments that a population has found with a fit about as good as the best known.

    Args:
        values: Points of the population, shape (n, size).
        best_fits: Best fit that any population has found of each set that is considered.
        solver: Computes fits.
    """
    unknowns = solver.predictor.unknowns
    keys = unknowns.keys(values)
    if not unknowns.choices.size:
        return set(keys)  # all have the same
    rows = [row for row, key in enumerate(keys) if key in best_fits]
    fits_by_key = zip((keys[row] for row in rows), solver.fits(values[rows]), strict=True)
    return {key for key, fit in fits_by_key if fit > best_fits[key] - _AS_GOOD}


_STRAGGLING: Final = 12.0  # nats below the best fit beyond which a chain is a straggler
_STRAGGLERS: Final = 0.5  # share of the coldest chains that may be stragglers in the end
_STEPS_FACTOR: Final = 3  # factor on the steps where it is not known which part sits on which
_RESTART_STEPS: Final = 100  # steps with each number of interactions after a restart


def explored(
    searches: Sequence[Discovery], workers: Executor, *, steps: int, rounds: int
) -> tuple[list[Discovery], Posterior, float]:
    """The posterior after the interactions so far, with the chains as its samples.

    Args:
        searches: One search for each population.
        workers: Executor that moves the chains.
        steps: Steps of each round where limbs are known, and of sampling after the last round.
        rounds: Largest number of rounds until all readings are explained; chains restart before a
            further round if some are not.

    Returns:
        The searches afterwards, the posterior, and its coverage by the populations.
    """
    moved = list(workers.map(partial(_explore, steps, rounds), searches))
    by_population = [drawn for _, drawn in moved]
    values, scales, fits = (np.concatenate(arrays) for arrays in zip(*by_population, strict=True))
    unknowns = searches[0].predictor.unknowns
    keys = unknowns.keys(values)
    best: dict[tuple[int, ...], list[int]] = {}
    for row in np.argsort(-fits, kind="stable").tolist():
        best.setdefault(keys[row], []).append(row)
    found = found_by_each(list(best), [set(unknowns.keys(drawn)) for drawn, _, _ in by_population])
    modes = sorted(
        (
            Mode(key, len(rows) / len(keys), values[rows[0]], float(len(rows)), tuple(flags))
            for (key, rows), flags in zip(best.items(), found.tolist(), strict=True)
        ),
        key=lambda mode: -mode.probability,
    )
    samples = Posterior.equally_likely(values, scales)
    posterior = replace(samples, modes=tuple(modes), adequate_fit=True)
    share = coverage(
        np.array([mode.probability for mode in modes]), np.array([mode.found for mode in modes])
    )
    return [search for search, _ in moved], posterior, share


def _explore(
    steps: int, rounds: int, search: Discovery
) -> tuple[Discovery, tuple[Array, Array, Array]]:
    """Moves the chains of one population; returns samples, their noise factors and their fits.

    Chains restart where the best body leaves something unexplained: an interaction may have led
    them far from the truth.
    """
    population, unknowns = search.population, search.predictor.unknowns
    round_steps = steps * (_STEPS_FACTOR if unknowns.parents.any() else 1)
    explained = True
    for _ in range(rounds):
        if not explained:
            search.restart(_RESTART_STEPS)
        bodies = search.search(round_steps)
        explained = search.explains()
        stragglers = _move_stragglers(population, bodies, search.rng)
        if explained and stragglers <= _STRAGGLERS:
            break
    chains, drawn = population.coldest(), []
    for step in range(steps):
        chains.step()
        if step % EVERY == EVERY - 1:
            fits = chains.posterior_fits(1)
            drawn.append((chains.values.copy(), chains.scales.copy(), fits))
    population.replace_coldest(*drawn[-1][:2])
    values, scales, fits = (np.concatenate(arrays) for arrays in zip(*drawn, strict=True))
    return search, (values, scales, fits)


def _move_stragglers(population: Population, bodies: BestPoints, rng: np.random.Generator) -> float:
    """Moves those of the coldest chains that lag far behind to bodies that fit; their share.

    Args:
        population: Population whose coldest chains are moved.
        bodies: The best points, best first.
        rng: Draws among these points.
    """
    cold = slice(0, population.chains_per_level)
    values, scales = population.values[cold].copy(), population.scales[cold].copy()
    rows = np.flatnonzero(population.posterior_fits(1) < bodies.fits[0] - _STRAGGLING)
    values[rows] = bodies.values[rng.choice(len(bodies.fits), rows.size, p=softmax(bodies.fits))]
    scales[rows] = 0.0
    population.replace_coldest(values, scales)
    return rows.size / population.chains_per_level
