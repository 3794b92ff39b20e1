"""The search for bodies that explain the readings: everything that happens before sampling.

Chains explore on their levels; every set of attachments that a colder level visits is kept, its
lengths are polished, and around the best few every other row of each part is tried. None of this
leaves the posterior invariant, and nothing of it needs to: it only says where the posterior is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.checks.verdict import fit_of
from estimator.posterior.discovery.moves import other_attachments
from estimator.posterior.discovery.neighbours import (
    Neighbours,
    joined_parts,
    ranked,
    ranked_by_attachments,
    with_subtrees_of_others,
)
from estimator.posterior.discovery.population import EVERY, Population
from estimator.posterior.model.gauss_newton import GaussNewton, best_of_each
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Attachments, Predictor, Unknowns

_WATCHED: Final = 3  # levels, from the coldest up
_WATCHING: Final = 4  # times fewer steps, while a body that all searches agreed on explains all
_POLISHED: Final = 200  # sets of attachments whose lengths are fitted, in one round
_POLISHED_BESIDE: Final = 40  # where neighbours are tried, too
_LEADERS: Final = 4  # in one sweep
_SWEPT: Final = (math.inf, 16.0)  # nats that they may lie below the best, in one and the next
_ELSEWHERE: Final = 800  # random lengths tried with a leader's attachments
_PROMISING: Final = 60  # of them polished,
_FINISHED: Final = 3  # and one in so many to the end, the best
_STARTS: Final = 24  # of these, fitted
_HIGHER: Final = 3.0  # nats, for which it is worth going on
_FOUNDERS: Final = 6  # bodies of each start whose subtrees others may take over,
_CROSSED: Final = 4  # the best few that do
_REMEMBERED: Final = 64  # of the best points, for the next interaction
_SEVERAL: Final = 4  # interactions, of which chains alone hardly ever explain all


@dataclass(frozen=True, kw_only=True)
class BestPoints:
    """The best point of each set of attachments, best first.

    Attributes:
        values: Shape (n, size).
        fits: Log-likelihoods, shape (n,).
    """

    values: Array
    fits: Array

    @classmethod
    def joined(cls, several: Sequence[BestPoints], unknowns: Unknowns) -> BestPoints:
        """The best of all, by set of attachments."""
        values = np.concatenate([one.values for one in several])
        fits = np.concatenate([one.fits for one in several])
        order = best_of_each(unknowns.keys(values), fits)
        return cls(values=values[order], fits=fits[order])


class Discovery:
    """The search with one population, in rounds.

    Args:
        population: Its chains are moved.
        predictor: The population's own.
        rng: The population's own, apart from its chains'.
        explores: Whether its chains have so much to find that they, and the neighbours of the best
            bodies, are all that is worth the time: other rows of single parts are not tried.

    Attributes:
        population: As above, like ``predictor`` and ``rng``.
        found: The best points that it found, shape (n, size): it begins with them when it observes.
        drawn: Points of the posterior with attachments that it found itself, shape (n, size): it
            begins with them, too. The best lengths so far may be far from the best ones now.
        converged: Attachments on which all searches agreed after the last interaction, if on any;
            several where sensors tell them apart hardly or not at all. While they explain the
            readings bodies near them are not tried again.
    """

    def __init__(
        self,
        population: Population,
        predictor: Predictor,
        rng: np.random.Generator,
        *,
        explores: bool,
    ) -> None:
        self.population = population
        self.predictor = predictor
        self.rng = rng
        self.found, self.drawn = np.empty((2, 0, predictor.unknowns.size))
        self.converged: frozenset[Attachments] = frozenset()
        self._explores = explores

    def observe(self, likelihood: Likelihood) -> None:
        """Takes in all observations; the search goes on from its chains and what it has found.

        Args:
            likelihood: Of all interactions.
        """
        predictor = self.predictor
        self._likelihood = likelihood
        self._founders: list[Array] = []
        self.population.observe(likelihood, surely=True)
        self._solver = GaussNewton(predictor, likelihood)
        self._neighbours = None
        if joined_parts(predictor.unknowns) and len(likelihood) >= _SEVERAL:
            self._neighbours = Neighbours(predictor.unknowns, self._solver, self.rng)
        self._before, self._visited = _Visited(predictor), _Visited(predictor)
        starts = np.concatenate([self.found, self.drawn])
        fits = self._solver.fits(starts)
        self._visited.add(starts, fits)
        if self._explores and len(starts):  # elsewhere searches would agree before all is found
            best = np.argsort(-fits, kind="stable")[:_STARTS]
            self._visited.add(*self._solver.polished(starts[best]))

    def search(self, steps: int) -> BestPoints:
        """One round.

        Args:
            steps: Of the chains; of those that only watch a body that all agreed on, a part.

        Returns:
            All sets of attachments that were found so far.
        """
        population, visited = self.population, self._visited
        for step in range(steps // _WATCHING if self._has_converged() else steps):
            population.step()
            if step % EVERY == EVERY - 1:
                levels = slice(0, _WATCHED * population.chains_per_level)
                visited.add(population.values[levels], population.posterior_fits(_WATCHED))
        visited.polish(self._solver, _POLISHED_BESIDE if self._explores else _POLISHED)
        if not self._has_converged():
            self._try_others(visited)
        bodies = self.best()
        self.found = bodies.values[:_REMEMBERED]
        return bodies

    def best(self) -> BestPoints:
        """All sets of attachments that were found so far."""
        both = [self._before.best(), self._visited.best()]
        return BestPoints.joined(both, self.predictor.unknowns)

    def _try_others(self, visited: _Visited) -> None:
        """Tries bodies near the best, and bodies that are made of several."""
        if self._neighbours:
            visited.climb(self._neighbours)
            if self._founders:
                self._recombine(self._neighbours)
        for nats in () if self._explores else _SWEPT:
            if not visited.sweep(self._solver, self.rng, nats):
                break

    def explains(self) -> bool:
        """Whether the best body explains all readings."""
        leader = self.best().values[0]
        return fit_of(leader, self.predictor, self._likelihood).unexplained == 0

    def _has_converged(self) -> bool:
        """Whether the best body is still the one that all agreed on, and explains the readings."""
        leader = self._visited.best().values[:1]
        if self.converged.isdisjoint(self.predictor.unknowns.keys(leader)):
            return False
        return not fit_of(leader[0], self.predictor, self._likelihood).is_improvable

    def _recombine(self, neighbours: Neighbours) -> None:
        """Gives the best bodies subtrees that other starts have found, and goes on from there."""
        founders = np.concatenate([*self._founders, self._visited.best().values[:_FOUNDERS]])
        everyone = self._before
        everyone.join(self._visited)
        while True:
            bodies = everyone.best()
            for body in bodies.values[:_CROSSED]:
                everyone.add_better(
                    *with_subtrees_of_others(body, founders, self.predictor.unknowns, self._solver)
                )
            everyone.climb(neighbours)
            if everyone.best().fits[0] < bodies.fits[0] + _HIGHER:
                break

    def start_anew(self, steps: int) -> None:
        """Draws all chains from the prior and lets them take in one interaction after the other.

        In random order, since one of them may mislead; and whatever was found before is left out of
        the search, though it still counts. Chains that are shown all readings at once find the
        body of a hard run a third as often at the same cost.

        Args:
            steps: With each number of interactions but the last.
        """
        likelihood, population = self._likelihood, self.population
        order = self.rng.permutation(len(likelihood))
        population.restart()
        for count in range(1, len(order)):
            population.observe(likelihood[order[:count]], surely=True)
            for _ in range(steps):
                population.step()
        population.observe(likelihood, surely=True)
        self._founders.append(self._visited.best().values[:_FOUNDERS])
        self._before.join(self._visited)
        self._visited = _Visited(self.predictor)


class _Visited:
    """Sets of attachments that were found, with the best point of each."""

    def __init__(self, predictor: Predictor) -> None:
        self._unknowns = predictor.unknowns
        self._points: dict[Attachments, tuple[float, Array]] = {}
        self._polished: set[Attachments] = set()
        self._swept: set[Attachments] = set()
        self._climbed: set[Attachments] = set()

    def add(self, values: Array, fits: Array) -> None:
        for key, fit, value in zip(self._unknowns.keys(values), fits.tolist(), values, strict=True):
            if key not in self._points or self._points[key][0] < fit:
                self._points[key] = fit, value.copy()

    def join(self, other: _Visited) -> None:
        """Adds all that another has found, and what became of it."""
        bodies = other.best()
        self.add(bodies.values, bodies.fits)
        self._polished |= other._polished
        self._swept |= other._swept
        self._climbed |= other._climbed

    def add_better(self, values: Array, fits: Array) -> None:
        """Adds points whose lengths are good."""
        self._polished.update(self._unknowns.keys(values))
        self.add(values, fits)

    def best(self) -> BestPoints:
        kept = sorted(self._points.values(), key=lambda item: -item[0])
        size = self._unknowns.size
        return BestPoints(
            values=np.array([value for _, value in kept]).reshape(len(kept), size),
            fits=np.array([fit for fit, _ in kept]),
        )

    def polish(self, solver: GaussNewton, count: int) -> None:
        values = self.best().values
        fresh = [key not in self._polished for key in self._unknowns.keys(values)]
        values = values[np.flatnonzero(fresh)[:count]]
        if len(values):
            self._add_polished(values, solver)

    def sweep(self, solver: GaussNewton, rng: np.random.Generator, nats: float) -> bool:
        """Tries other rows of each part of the best few; False when there is nobody to be swept."""
        bodies = self.best()
        leaders = bodies.values[bodies.fits >= bodies.fits[0] - nats][: 2 * _LEADERS]
        keys = self._unknowns.keys(leaders)
        chosen = [row for row, key in enumerate(keys) if key not in self._swept][:_LEADERS]
        for row in chosen:
            self._swept.add(keys[row])
            values = np.concatenate(
                [
                    other_attachments(leaders[row], columns, self._unknowns, rng)
                    for columns in self._unknowns.parts.values()
                ]
            )
            promising = ranked_by_attachments(values, solver, self._unknowns, rng)[:_PROMISING]
            self._add_polished(promising, solver)
            self._add_polished(self._elsewhere(leaders[row], solver, rng), solver)
        return bool(chosen)

    def climb(self, neighbours: Neighbours) -> None:
        """Tries the neighbours of the best, as long as that finds something much better."""
        while True:
            bodies = self.best()
            keys = self._unknowns.keys(bodies.values)
            row = next((row for row, key in enumerate(keys) if key not in self._climbed), None)
            if row is None:
                break
            self._climbed.add(keys[row])
            self.add_better(*neighbours.of(bodies.values[row]))
            if self.best().fits[0] < bodies.fits[0] + _HIGHER:
                break

    def _elsewhere(self, leader: Array, solver: GaussNewton, rng: np.random.Generator) -> Array:
        """Starts with a leader's attachments and other lengths, since peaks may be several."""
        columns = self._unknowns.continuous
        trial = np.repeat(leader[None], _ELSEWHERE, axis=0)
        trial[:, columns] = rng.random((_ELSEWHERE, columns.size))
        return ranked(trial, solver, rng)[:_STARTS]

    def _add_polished(self, values: Array, solver: GaussNewton) -> None:
        better, fits = solver.polished(values, math.ceil(len(values) / _FINISHED))
        self._polished.update(self._unknowns.keys(values))
        self.add(better, fits)
