"""Fits the population to observations, generation by generation."""

from __future__ import annotations

from collections.abc import Sequence

from estimator.body.morphology import Array
from estimator.exploration.rules import Objective
from estimator.identification.paper.fit import fit_genes
from estimator.physics.base import ArrayPhysics, Physics
from estimator.problem.genome import Genome
from estimator.readings.observation import Observation
from estimator.search.searches import Search
from estimator.storage.records import Counters


class Modeller:
    """Evaluates and evolves models.

    Args:
        genome: The code between genes and bodies.
        physics: Predicts what bodies feel.
        modalities: Modalities that count.
        counters: What the run has cost so far.
        objective: What models are fitted by.
        foresight: Guesses what a slower back-end will find; see ``fit_genes``.
    """

    def __init__(
        self,
        genome: Genome,
        physics: Physics,
        modalities: Sequence[str],
        counters: Counters,
        *,
        objective: Objective,
        foresight: ArrayPhysics | None = None,
    ):
        self._genome = genome
        self._physics = physics
        self._objective = objective
        self._foresight = foresight
        self._modalities = tuple(modalities)
        self._requested = counters.simulations_requested
        self._run = counters.simulations_run - physics.simulations
        self._invalid = counters.simulations_invalid
        self._undecided = counters.simulations_undecided
        self._steps = counters.steps - physics.steps

    def counters(self, wall_seconds: float) -> Counters:
        """What the run has cost by now."""
        return Counters(
            simulations_requested=self._requested,
            simulations_run=self._run + self._physics.simulations,
            simulations_invalid=self._invalid,
            simulations_undecided=self._undecided,
            steps=self._steps + self._physics.steps,
            wall_seconds=wall_seconds,
        )

    def introduce(self, search: Search, observations: Sequence[Observation]) -> None:
        """Evaluates the population after an interaction, on all observations so far."""
        if len(observations) > 1:
            search.forget_errors()
        population = search.ask()
        self._requested += len(population) * len(observations)
        search.tell(self._errors(population, search.limits, observations))

    def evolve(self, search: Search, observations: Sequence[Observation]) -> None:
        """One generation of children, each competing with a parent."""
        children = search.ask()
        self._requested += len(children) * len(observations)
        search.tell(self._errors(children, search.limits, observations))

    def _errors(self, genes: Array, limits: Array, observations: Sequence[Observation]) -> Array:
        fitted = fit_genes(
            self._genome,
            genes,
            observations,
            self._modalities,
            self._physics,
            objective=self._objective,
            limits=limits,
            foresight=self._foresight,
        )
        self._invalid += fitted.invalid
        self._undecided += fitted.undecided
        return fitted.errors
