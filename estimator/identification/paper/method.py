"""The paper's method: a population of models is optimised for some generations."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from estimator.body.morphology import Array
from estimator.errors import EstimatorError, SearchStateError
from estimator.identification.method import Listener
from estimator.identification.paper.fit import Modeller
from estimator.identification.paper.objectives import OBJECTIVES
from estimator.identification.paper.reference_check import finish
from estimator.identification.paper.search import SEARCHES, Search
from estimator.physics.backends import (
    REFERENCE,
    approximation_of,
    open_predicting,
    physics_class,
)
from estimator.physics.base import ArrayPhysics
from estimator.posterior.checks.verdict import judge_body
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.posterior import Posterior
from estimator.randomness import Stream, generator
from estimator.readings.observation import Observation
from estimator.storage.records import BestFit, Counters, Generation
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore
from estimator.workplaces import Executors


class PaperMethod:
    """A search, by default deterministic crowding, on the error over all interactions.

    The reference back-end, if another one searched, ranks the leading models; statics judges the
    best one.
    """

    PHYSICS: ClassVar = REFERENCE
    RULE: ClassVar = "random"

    @staticmethod
    def check(config: RunConfig) -> None:
        """Refuses settings that need samples of a posterior, and a physics that is not there.

        Raises:
            EstimatorError: The config has such a setting.
        """
        physics_class(config.physics or PaperMethod.PHYSICS)
        if config.sure is not None:
            raise EstimatorError(
                "sure belongs to the method posterior, since a population does not know how good "
                "it is: leave it out, or leave out --method paper"
            )
        if config.learn != "all":
            raise EstimatorError(
                f"--learn {config.learn} belongs to the method posterior: leave it out, or leave "
                "out --method paper"
            )

    def __init__(
        self, store: RunStore, executors: Executors, listener: Listener, stack: ExitStack
    ) -> None:
        settings, world = store.settings, store.world
        self._store = store
        self._executors = executors
        self._listener = listener
        choosing = open_predicting(settings.physics, world)
        self.choosing: ArrayPhysics = stack.enter_context(closing(choosing))
        physics = stack.enter_context(closing(executors.open_physics(settings.physics, world)))
        self._objective = OBJECTIVES.load(settings.objective)(store.capabilities)
        checkpoint = store.checkpoint()
        self._generations_done = 0 if checkpoint is None else checkpoint.number + 1
        latest = store.latest_generation()
        counters = Counters() if latest is None else latest.counters
        self._seconds_before = counters.wall_seconds
        self._started = time.monotonic()
        self._modeller = Modeller(
            store.genome,
            physics,
            settings.modalities,
            counters,
            objective=self._objective,
            approximation=approximation_of(settings.physics, world),
        )
        operators = replace(store.problem.search.operators(), permit=store.genome.permitted)
        search = SEARCHES.load(settings.search)
        self._search: Search
        if checkpoint is None:
            self._search = search(
                settings.population,
                store.genome.size,
                generator(settings.seed, Stream.SEARCH),
                operators=operators,
            )
        else:
            _check_algorithm(checkpoint.state, search.algorithm)
            self._search = search.from_state(checkpoint.state, operators=operators)

    def work(self, number: int) -> float:
        """Number of simulations after an interaction, if none is saved by an early verdict."""
        first = self._first(number)
        return sum(self._size(generation) for generation in range(first, self._first(number + 1)))

    def done(self, number: int) -> float:
        """Number of simulations, counted as by ``work``, of the generations that are on disk."""
        end = min(self._first(number + 1), self._generations_done)
        return sum(self._size(generation) for generation in range(self._first(number), end))

    def learn(self, number: int, observations: Sequence[Observation]) -> None:
        """Does the generations that follow an interaction, but for those that are on disk."""
        settings = self._store.settings
        first = self._first(number)
        for generation in range(first, self._first(number + 1)):
            if generation < self._generations_done:
                continue
            if generation == first:
                self._modeller.introduce(self._search, observations)
            else:
                self._modeller.evolve(self._search, observations)
            seconds = self._seconds_before + time.monotonic() - self._started
            record = Generation(
                number=generation,
                iteration=number,
                errors=tuple(self._search.errors.tolist()),
                best=tuple(np.asarray(self._search.population[self._search.best]).tolist()),
                counters=self._modeller.counters(seconds),
            )
            self._store.save(record, self._search.state())
            self._listener.worked(
                self._size(generation),
                f"interaction {number + 1}/{settings.interactions}, generation "
                f"{generation - first}/{settings.generations}, error {min(record.errors):.2f}",
            )

    def posterior(self) -> FittedPosterior:
        """The population as a posterior, in which all members are equally likely."""
        search, begun = self._search, self._store.latest_generation() is not None
        samples = Posterior.equally_likely(search.population)
        fitted = FittedPosterior.in_run(self._store, samples, self._store.observations())
        return replace(fitted, best=search.population[search.best]) if begun else fitted

    def is_sure(self, number: int) -> bool:
        """Returns false: a population does not know how good it is."""
        del number
        return False

    def finish(self, observations: Sequence[Observation]) -> None:
        """Has the leading models simulated by the reference, and the best one judged."""
        latest = self._store.latest_generation()
        assert latest is not None
        errors = np.array(latest.errors, dtype=float)
        self._check_leaders(errors, observations)
        if not self._store.search_end.is_reached:
            fitted = FittedPosterior.of(self._store)
            assert fitted is not None
            self._store.search_end.save_best_fit(self._judged(fitted.computed_by(self.choosing)))

    def _check_leaders(self, errors: Array, observations: Sequence[Observation]) -> None:
        settings = self._store.settings
        searched_by_reference = settings.physics == settings.reference
        if searched_by_reference or self._store.search_end.finish() is not None:
            return
        with closing(
            self._executors.open_physics(settings.reference, self._store.world)
        ) as reference:
            checked = finish(
                self._store.genome,
                self._search.population,
                errors,
                observations=observations,
                modalities=settings.modalities,
                physics=reference,
                objective=self._objective,
            )
        self._store.search_end.save_finish(checked)

    def _judged(self, fitted: FittedPosterior) -> BestFit | None:
        """How the best model explains the readings; ``None`` where it cannot be believed."""
        assert fitted.best is not None
        assert fitted.searched is not None
        if not np.isfinite(fitted.searched[fitted.ranked[0]]):
            return None
        verdict = judge_body(fitted.best, fitted.predictor, fitted.likelihood)
        return BestFit(
            interactions=len(fitted.observations),
            unexplained=verdict.unexplained,
            noisy=verdict.noisy,
            contradicting=verdict.contradicting,
        )

    def _first(self, interaction: int) -> int:
        """Number of the first generation after an interaction."""
        return interaction * (self._store.settings.generations + 1)

    def _size(self, generation: int) -> int:
        """Number of simulations of a generation, if none is saved by an early verdict."""
        iteration, step = divmod(generation, self._store.settings.generations + 1)
        return self._store.settings.population * (iteration + 1 if step else 1)


def _check_algorithm(state: Mapping[str, Any], algorithm: str) -> None:
    """Refuses to go on with what another search has left."""
    if state.get("algorithm") != algorithm:
        raise SearchStateError(
            f"the run was made by {state.get('algorithm')!r}, and {algorithm!r} cannot go on with "
            "that: install the search of that time, or start a new run"
        )
