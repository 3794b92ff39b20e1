"""The search for bodies that explain the readings, which precedes sampling.

Chains explore on their levels; every set of attachments that a colder level visits is kept, its
lengths are optimised, and of the best few every other attachment of each part is tried. This need
not leave the posterior invariant, and does not: it only finds where the posterior is.
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
    with_subtrees_of_others,
)
from estimator.posterior.discovery.population import EVERY, Population
from estimator.posterior.model.gauss_newton import GaussNewton, best_of_each
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Attachments, Predictor, Unknowns

_WATCHED_LEVELS: Final = 3  # coldest levels, whose chains' attachments are kept
_FEW_STEPS: Final = 2 * EVERY  # steps where chains hardly have to look for attachments
_POLISHED: Final = 200  # sets of attachments whose lengths are optimised in one round
_POLISHED_OF_MANY: Final = 40  # the same where many attachments are open
_LEADERS: Final = 4  # sets of attachments in one sweep
_SWEPT: Final = (math.inf, 16.0)  # nats that they may lie below the best, in each sweep of a round
_PROMISING: Final = 60  # other attachments of a leader whose lengths are optimised
_FINISHED: Final = 3  # one in so many of those points, the best, is optimised to the end
_STARTS: Final = 24  # best points of the last search, whose lengths are optimised
_IMPROVEMENT: Final = 3.0  # nats of improvement from which neighbours are tried again
_FOUNDERS: Final = 6  # best bodies of each restart, whose subtrees are given to others
_CROSSED: Final = 4  # best bodies that are given subtrees
_REMEMBERED: Final = 64  # best points that are kept for the next interaction
_NEIGHBOURS_FROM: Final = 4  # interactions from which neighbours are tried


@dataclass(frozen=True, kw_only=True)
class BestPoints:
    """The best point of each set of attachments, best first.

    Attributes:
        values: Points of the cube, shape (n, size).
        fits: Log-likelihoods, shape (n,).
    """

    values: Array
    fits: Array

    @classmethod
    def joined(cls, several: Sequence[BestPoints], unknowns: Unknowns) -> BestPoints:
        """The best point of each set of attachments among several collections."""
        values = np.concatenate([bodies.values for bodies in several])
        fits = np.concatenate([bodies.fits for bodies in several])
        order = best_of_each(unknowns.keys(values), fits)
        return cls(values=values[order], fits=fits[order])


class Discovery:
    """The search with one population, in rounds.

    Args:
        population: Population whose chains are moved.
        predictor: Predictor of this population alone.
        rng: Random generator of this search; the population's chains have another.
        explores: Whether many attachments are open: then only the neighbours of the best bodies
            are tried beside the chains, and no sweeps of single parts are made.

    Attributes:
        population: As above, like ``predictor`` and ``rng``.
        starts: Points with which the search begins when it observes, shape (n, size): the best that
            it found, and points of the posterior with attachments that it found itself, since new
            readings may move the best lengths far.
        converged: Attachments on which all searches agreed after the last interaction, if on any;
            several where sensors hardly discriminate between them. While they explain the readings
            bodies near them are not tried again.
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
        self.starts = np.empty((0, predictor.unknowns.size))
        self.converged: frozenset[Attachments] = frozenset()
        self._explores = explores

    def observe(self, likelihood: Likelihood) -> None:
        """Takes in all observations by their likelihood; goes on from its chains and points."""
        predictor = self.predictor
        self._likelihood = likelihood
        self._founders: list[Array] = []
        self.population.observe(likelihood, surely=True)
        self._solver = GaussNewton(predictor, likelihood)
        self._neighbours = None
        if joined_parts(predictor.unknowns) and len(likelihood) >= _NEIGHBOURS_FROM:
            self._neighbours = Neighbours(predictor.unknowns, self._solver, self.rng)
        self._visited_before, self._visited = _Visited(predictor), _Visited(predictor)
        fits = self._solver.fits(self.starts)
        self._visited.add(self.starts, fits)
        if self._explores and len(fits):  # with fewer attachments searches would agree too early
            best = np.argsort(-fits, kind="stable")[:_STARTS]
            self._visited.add(*self._solver.polished(self.starts[best]))

    def search(self, steps: int) -> BestPoints:
        """Makes one round of the search; returns the best points as ``best`` does.

        Args:
            steps: Steps of the chains; at most ten where the search has converged, or lengths alone
                are open.
        """
        population, visited = self.population, self._visited
        is_brief = self._has_converged() or not self.predictor.unknowns.choices.size
        for step in range(min(steps, _FEW_STEPS) if is_brief else steps):
            population.step()
            if step % EVERY == EVERY - 1:
                levels = slice(0, _WATCHED_LEVELS * population.chains_per_level)
                visited.add(population.values[levels], population.posterior_fits(_WATCHED_LEVELS))
        visited.polish(self._solver, _POLISHED_OF_MANY if self._explores else _POLISHED)
        if not self._has_converged():
            self._try_others(visited)
        bodies = self.best()
        self.starts = bodies.values[:_REMEMBERED]
        return bodies

    def best(self) -> BestPoints:
        """The best points of all sets of attachments that were found so far."""
        collections = [self._visited_before.best(), self._visited.best()]
        return BestPoints.joined(collections, self.predictor.unknowns)

    def _try_others(self, visited: _Visited) -> None:
        """Tries bodies near the best ones, and recombinations of bodies."""
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
        """Whether the best body still has converged attachments, and explains the readings."""
        leader = self._visited.best().values[:1]
        if self.converged.isdisjoint(self.predictor.unknowns.keys(leader)):
            return False
        return not fit_of(leader[0], self.predictor, self._likelihood).is_improvable

    def _recombine(self, neighbours: Neighbours) -> None:
        """Gives the best bodies subtrees that earlier starts have found, and tries neighbours."""
        founders = np.concatenate([*self._founders, self._visited.best().values[:_FOUNDERS]])
        visited = self._visited_before
        visited.join(self._visited)
        while True:
            bodies = visited.best()
            for body in bodies.values[:_CROSSED]:
                visited.add_polished(
                    *with_subtrees_of_others(body, founders, self.predictor.unknowns, self._solver)
                )
            visited.climb(neighbours)
            if visited.best().fits[0] < bodies.fits[0] + _IMPROVEMENT:
                break

    def restart(self, steps: int) -> None:
        """Draws all chains from the prior and has them observe one interaction after the other.

        The order is random, since any one may mislead. Points found before are left out of the
        search, but stay among its results. Chains that observe all readings at once find the body
        of a hard run a third as often at the same cost.

        Args:
            steps: Steps with each number of interactions but the last.
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
        self._visited_before.join(self._visited)
        self._visited = _Visited(self.predictor)


class _Visited:
    """Sets of attachments that a search has visited, with the best point of each."""

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
        """Adds all that another has visited, and what was done with it."""
        bodies = other.best()
        self.add(bodies.values, bodies.fits)
        self._polished |= other._polished
        self._swept |= other._swept
        self._climbed |= other._climbed

    def add_polished(self, values: Array, fits: Array) -> None:
        """Adds points whose lengths are optimised."""
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
        unpolished = [key not in self._polished for key in self._unknowns.keys(values)]
        values = values[np.flatnonzero(unpolished)[:count]]
        if len(values):
            self._polish([values], solver)

    def sweep(self, solver: GaussNewton, rng: np.random.Generator, nats: float) -> bool:
        """Tries other attachments of each part of the best few points not tried yet.

        Returns False where none of these is left.
        """
        bodies = self.best()
        leaders = bodies.values[bodies.fits >= bodies.fits[0] - nats][: 2 * _LEADERS]
        keys = self._unknowns.keys(leaders)
        chosen = [row for row, key in enumerate(keys) if key not in self._swept][:_LEADERS]
        promising = []
        for row in chosen:
            self._swept.add(keys[row])
            values = np.concatenate(
                [
                    other_attachments(leaders[row], columns, self._unknowns, rng)
                    for columns in self._unknowns.parts.values()
                ]
            )
            promising.append(ranked(values, solver, self._unknowns, rng)[:_PROMISING])
        if chosen:
            self._polish(promising, solver)
        return bool(chosen)

    def climb(self, neighbours: Neighbours) -> None:
        """Tries the neighbours of the best body, as long as that finds a much better one."""
        while True:
            bodies = self.best()
            keys = self._unknowns.keys(bodies.values)
            row = next((row for row, key in enumerate(keys) if key not in self._climbed), None)
            if row is None:
                break
            self._climbed.add(keys[row])
            self.add_polished(*neighbours.of(bodies.values[row]))
            if self.best().fits[0] < bodies.fits[0] + _IMPROVEMENT:
                break

    def _polish(self, several: Sequence[Array], solver: GaussNewton) -> None:
        """Optimises the lengths of some points of each of several arrays."""
        values, sizes = np.concatenate(several), [len(points) for points in several]
        groups = np.repeat(np.arange(len(sizes)), sizes)
        better, fits = solver.polished(values, math.ceil(max(sizes) / _FINISHED), groups=groups)
        self._polished.update(self._unknowns.keys(values))
        self.add(better, fits)
