"""How searches begin, and searches of robots of which one thing is otherwise than stated.

A deviation that either is so or not, such as exchanged plugs or a dead servo, changes what readings
say of all bodies. Unless it is known the right body may explain them no better than others, so it
is no use to ask which of the bodies that were found without the deviation explain them with it.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.physics.base import ArrayPhysics
from estimator.posterior.discovery.discovery import Discovery
from estimator.posterior.discovery.population import Population
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Cost, Predictor, Unknowns

_BEST_POINTS: Final = 4  # best points that are taken from each search


@dataclass(frozen=True, kw_only=True)
class Beginning:
    """How searches of a problem begin; travels to worker processes.

    Attributes:
        unknowns: The cube, with all that may deviate.
        make_physics: Makes a back-end for each search.
        levels: Number of levels of each population.
        chains_per_level: Number of chains on each level.
    """

    unknowns: Unknowns
    make_physics: Callable[[], ArrayPhysics]
    levels: int
    chains_per_level: int

    def search(self, deviations: Array, seed: np.random.SeedSequence) -> Discovery:
        """A search for bodies that all have these deviations, shape (rows,)."""
        unknowns = self.unknowns
        predictor = Predictor(unknowns.with_fixed_deviations(deviations), self.make_physics())
        chains_rng, search_rng = map(np.random.default_rng, seed.spawn(2))
        population = Population.of_prior(
            predictor, chains_rng, levels=self.levels, chains_per_level=self.chains_per_level
        )
        return Discovery(population, predictor, search_rng, explores=unknowns.many)

    def found_with_each(
        self, likelihood: Likelihood, steps: int, rng: np.random.Generator, workers: Executor
    ) -> tuple[Array, Cost]:
        """The best points with each wide component that has no amount, and what these cost.

        Args:
            likelihood: Likelihood of all observations.
            steps: Steps of a round of the search.
            rng: Seeds the searches.
            workers: Executor that makes the searches; its number of workers changes no result.

        Returns:
            Points, shape (n, size), and the cost of all searches.
        """
        table = self.unknowns.table
        switches = [n for n, row in enumerate(table) if row.switch and row.may_deviate]
        seeds = np.random.SeedSequence(int(rng.integers(2**32))).spawn(len(switches))
        by_search = zip(np.eye(len(table))[switches], seeds, strict=True)
        tasks = [(likelihood, steps, deviations, seed) for deviations, seed in by_search]
        best_points, costs = [np.empty((0, self.unknowns.size))], []
        for points, cost in workers.map(self.found_with_cost, tasks):
            best_points.append(points)
            costs.append(cost)
        return np.concatenate(best_points), Cost(*map(sum, zip(Cost(0, 0), *costs, strict=True)))

    def found_with_cost(
        self, task: tuple[Likelihood, int, Array, np.random.SeedSequence]
    ) -> tuple[Array, Cost]:
        """The best points that one search finds, and its cost.

        Args:
            task: Likelihood of all observations, steps of a round, deviations, and a seed.
        """
        likelihood, steps, deviations, seed = task
        search = self.search(deviations, seed)
        search.observe(likelihood)
        search.restart(steps)
        best = search.search(steps).values[:_BEST_POINTS]
        return self.unknowns.with_deviations(best, deviations), search.predictor.cost
