"""Fits the population to observations: subjective errors, with a verdict as early as is exact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimator.error import Observed, interaction_errors
from estimator.genome import Genome
from estimator.morphology import Array
from estimator.observation import Observation
from estimator.physics.base import Physics
from estimator.records import Counters
from estimator.search.deterministic_crowding import DeterministicCrowding


def observed(observation: Observation) -> Observed:
    """An observation as arrays; NaN where a reading is missing."""
    missing = float("nan")
    return Observed(
        angles=np.array(observation.angles, dtype=float),
        touch=np.array([missing if bit is None else bit for bit in observation.touch], dtype=float),
        tilt=np.array([missing if angle is None else angle for angle in observation.tilt]),
        clearance=missing if observation.clearance is None else observation.clearance,
    )


class Modeller:
    """Evaluates and evolves models.

    Args:
        genome: The code between genes and bodies.
        physics: Predicts what bodies feel.
        modalities: Modalities that count.
        counters: What the run has cost so far.
    """

    def __init__(
        self, genome: Genome, physics: Physics, modalities: Sequence[str], counters: Counters
    ):
        self._genome = genome
        self._physics = physics
        self._modalities = tuple(modalities)
        self._requested = counters.simulations_requested
        self._run = counters.simulations_run - physics.simulations
        self._steps = counters.steps - physics.steps

    def counters(self, wall_seconds: float) -> Counters:
        """What the run has cost by now."""
        return Counters(
            simulations_requested=self._requested,
            simulations_run=self._run + self._physics.simulations,
            steps=self._steps + self._physics.steps,
            wall_seconds=wall_seconds,
        )

    def introduce(self, search: DeterministicCrowding, observations: Sequence[Observation]) -> None:
        """Evaluates the population after an interaction, on all observations so far.

        Only the last of them is simulated: the error is a maximum, and that over the earlier ones
        is known.
        """
        if len(observations) == 1:
            known = np.zeros(len(search.population))
        else:
            known = search.errors
            search.forget_errors()
        population = search.ask()
        self._requested += len(population) * len(observations)
        search.tell(np.maximum(known, self._errors(population, search.limits, observations[-1:])))

    def evolve(self, search: DeterministicCrowding, observations: Sequence[Observation]) -> None:
        """One generation of children, each competing with a parent."""
        children = search.ask()
        self._requested += len(children) * len(observations)
        search.tell(self._errors(children, search.limits, observations))

    def _errors(self, genes: Array, limits: Array, observations: Sequence[Observation]) -> Array:
        """Largest error of each model; where it reaches the model's limit, at least the limit.

        A model that has reached its limit in one interaction has lost, and is not simulated in the
        others. The latest interaction comes first, since the parents were not selected on it for
        as long as on the others.
        """
        bodies = self._genome.decode_all(genes)
        errors = np.zeros(len(bodies))
        alive = np.arange(len(bodies))
        for observation in reversed(observations):
            if not alive.size:
                break
            target = observed(observation)
            readings = self._physics.read([(bodies[index], target.angles) for index in alive])
            found = interaction_errors(readings, target, self._modalities)
            errors[alive] = np.maximum(errors[alive], found)
            alive = alive[errors[alive] < limits[alive]]
        return errors
