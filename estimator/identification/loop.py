"""Act, sense, model: the estimation-exploration loop of the paper, with random motor programs."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from estimator.errors import InteractionError
from estimator.identification.acting import carry_out
from estimator.identification.exploration import rule
from estimator.identification.listener import Listener
from estimator.identification.modelling import Modeller
from estimator.physics.base import ArrayPhysics, Physics
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation, Program
from estimator.robot_link.base import RobotLink
from estimator.search.deterministic_crowding import DeterministicCrowding
from estimator.search.randomness import Stream, generator
from estimator.storage.records import Counters, Generation, InteractionRecord
from estimator.storage.store import RunStore

Connect = Callable[[], RobotLink]
"""Reaches the robot when it is first needed."""


class Identification:
    """One run, from wherever its store says it stands to its end.

    Args:
        store: The run's memory; opened for writing.
        problem: The run's problem.
        physics: Predicts what models feel.
        connect: Reaches the robot; called at most once, and not at all when every interaction is
            done already.
        listener: Hears what happens.
        foresight: Guesses what models feel, where ``physics`` is slower.
    """

    def __init__(
        self,
        store: RunStore,
        problem: Problem,
        physics: Physics,
        connect: Connect,
        listener: Listener,
        *,
        foresight: ArrayPhysics | None = None,
    ):
        self._store = store
        self._problem = problem
        self._connect = connect
        self._listener = listener
        self._link: RobotLink | None = None
        self._genome = Genome(problem, problem.base(store.capabilities))
        checkpoint = store.checkpoint()
        self._done = 0 if checkpoint is None else checkpoint.generation + 1
        counters = store.generations()[-1].counters if checkpoint else Counters()
        self._seconds_before = counters.wall_seconds
        self._started = time.monotonic()
        self._modeller = Modeller(
            self._genome, physics, store.settings.modalities, counters, foresight=foresight
        )
        operators = problem.search.operators()
        if checkpoint is None:
            self._search = DeterministicCrowding(
                store.settings.population,
                self._genome.size,
                generator(store.settings.seed, Stream.SEARCH),
                operators=operators,
            )
        else:
            self._search = DeterministicCrowding.from_state(checkpoint.state, operators=operators)

    def run(self, after_iteration: Callable[[], object]) -> None:
        """Goes through all interactions, each followed by the search.

        Args:
            after_iteration: Called whenever an iteration is over.

        Raises:
            InteractionError: The robot did not do its part; ``run`` of a new object goes on.
        """
        observations: list[Observation] = []
        settings = self._store.settings
        work = [self._work(n) for n in range(settings.interactions * (settings.generations + 1))]
        self._listener.expect(sum(work), sum(work[: self._done]))
        try:
            for number in range(settings.interactions):
                observations.append(self._act(number))
                self._model(number, observations)
                after_iteration()
        finally:
            if self._link is not None:
                self._link.close()

    def _act(self, number: int) -> Observation:
        """The observation of an interaction, which is performed if it was not yet."""
        interactions = self._store.interactions()
        planned = interactions[number] if number < len(interactions) else None
        if planned is not None and planned.observation is not None:
            return planned.observation
        if self._link is None:
            self._link = self._connect()
        if planned is None:
            planned = InteractionRecord(program=self._program(number, self._link))
            self._store.plan(number, planned.program)
        commit = partial(self._store.ask, number)
        observation = carry_out(self._link, number, planned, commit, self._listener)
        self._store.observe(number, observation)
        self._listener.observed(number, observation)
        return observation

    def _program(self, number: int, link: RobotLink) -> Program:
        if link.recorded is None:
            rng = generator(self._store.settings.seed, Stream.PROGRAMS, number)
            return rule(self._store.settings.explore)(self._problem, self._store.capabilities, rng)
        if number >= len(link.recorded):
            raise InteractionError(
                f"interaction {number + 1} was never recorded: the record holds "
                f"{len(link.recorded)}. Add it to the record and resume."
            )
        return link.recorded[number]

    def _model(self, iteration: int, observations: list[Observation]) -> None:
        """The generations that follow an interaction; those already on disk are not repeated."""
        settings = self._store.settings
        first = iteration * (settings.generations + 1)
        for number in range(first, first + settings.generations + 1):
            if number < self._done:
                continue
            if number == first:
                self._modeller.introduce(self._search, observations)
            else:
                self._modeller.evolve(self._search, observations)
            seconds = self._seconds_before + time.monotonic() - self._started
            generation = Generation(
                number=number,
                iteration=iteration,
                errors=tuple(self._search.errors.tolist()),
                best=tuple(np.asarray(self._search.population[self._search.best]).tolist()),
                counters=self._modeller.counters(seconds),
            )
            self._store.save(generation, self._search.state())
            self._listener.worked(
                self._work(number),
                f"interaction {iteration + 1}/{settings.interactions}, generation "
                f"{number - first}/{settings.generations}, error {min(generation.errors):.2f}",
            )

    def _work(self, number: int) -> int:
        """Simulations of a generation, before any early verdict."""
        iteration, step = divmod(number, self._store.settings.generations + 1)
        return self._store.settings.population * (iteration + 1 if step else 1)
