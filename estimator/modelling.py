"""Fits the population to observations: subjective errors, with a verdict as early as is exact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from estimator.error import Observed, interaction_errors, largest
from estimator.genome import Genome
from estimator.morphology import Array, Morphology
from estimator.observation import Observation
from estimator.physics.base import Physics, Readings
from estimator.physics.bodies import Bodies
from estimator.physics.statics import StaticsPhysics
from estimator.records import Counters
from estimator.search.deterministic_crowding import DeterministicCrowding

Rows: TypeAlias = NDArray[np.intp]


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
        """Evaluates the population after an interaction, on all observations so far."""
        if len(observations) > 1:
            search.forget_errors()
        population = search.ask()
        self._requested += len(population) * len(observations)
        search.tell(self._errors(population, search.limits, observations))

    def evolve(self, search: DeterministicCrowding, observations: Sequence[Observation]) -> None:
        """One generation of children, each competing with a parent."""
        children = search.ask()
        self._requested += len(children) * len(observations)
        search.tell(self._errors(children, search.limits, observations))

    def _errors(self, genes: Array, limits: Array, observations: Sequence[Observation]) -> Array:
        read = _reader(self._genome, genes, self._physics)
        return _largest_errors(read, limits, observations, self._modalities)


def subjective_errors(
    bodies: Sequence[Morphology],
    observations: Sequence[Observation],
    modalities: Sequence[str],
    physics: Physics,
) -> Array:
    """Largest error of each body over the observations, shape (n,)."""
    read = _BodyReader(bodies, physics)
    return _largest_errors(read, np.full(len(bodies), np.inf), observations, modalities)


class _Reader(Protocol):
    def __call__(self, rows: Rows, angles: Array) -> Readings: ...


@dataclass(frozen=True)
class _BodyReader:
    """Bodies one by one, for back-ends that simulate them one by one."""

    bodies: Sequence[Morphology]
    physics: Physics

    def __call__(self, rows: Rows, angles: Array) -> Readings:
        return self.physics.read([(self.bodies[row], angles) for row in rows])


@dataclass(frozen=True)
class _ArrayReader:
    """A whole population as arrays, for a back-end that takes them."""

    bodies: Bodies
    physics: StaticsPhysics

    def __call__(self, rows: Rows, angles: Array) -> Readings:
        return self.physics.read_bodies(self.bodies[rows], angles)


def _reader(genome: Genome, genes: Array, physics: Physics) -> _Reader:
    if isinstance(physics, StaticsPhysics):
        return _ArrayReader(genome.bodies(genes), physics)
    return _BodyReader(genome.decode_all(genes), physics)


def _largest_errors(
    read: _Reader, limits: Array, observations: Sequence[Observation], modalities: Sequence[str]
) -> Array:
    """Largest error of each model; where it reaches the model's limit, at least the limit.

    A model that has reached its limit in one interaction has lost, and is not simulated in the
    others. The latest interaction comes first, since the parents were not selected on it for as
    long as on the others.
    """
    errors = np.zeros((len(observations), len(limits)))
    undecided = np.zeros(errors.shape, dtype=bool)
    alive = np.arange(len(limits))
    for row, observation in enumerate(reversed(observations)):
        if not alive.size:
            break
        target = observed(observation)
        readings = read(alive, target.angles)
        errors[row, alive] = interaction_errors(readings, target, modalities)
        undecided[row, alive] = readings.undecided
        alive = alive[errors[row, alive] < limits[alive]]
    return largest(errors, undecided)
