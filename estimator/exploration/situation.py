"""What an exploration rule is told, and what it answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from estimator.body.arrays import Bodies, Flags
from estimator.body.morphology import Array
from estimator.physics.base import ArrayMarginPhysics, Readings
from estimator.posterior.information import systematic
from estimator.posterior.model.departures import Doubt
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation, ObservedReadings, Program
from protocol.wire.capabilities import Capabilities


class Objective(Protocol):
    """What the paper's search minimises."""

    def __init__(self, capabilities: Capabilities) -> None: ...

    def terms(
        self, readings: Readings, observed: ObservedReadings, modalities: Sequence[str]
    ) -> Array:
        """Error of each of n models in one interaction, shape (n,).

        At least 0; infinite where a model's reading is invalid.
        """

    def lower_bound(self, terms: Array) -> Array:
        """What the total is at least, shape (n,): a model that reaches its limit has lost.

        Args:
            terms: Of n models in k interactions, shape (k, n); 0 where not yet computed.
        """

    def total(self, terms: Array, undecided: Flags) -> Array:
        """The figure over all interactions, shape (n,).

        Args:
            terms: Shape (k, n).
            undecided: Whether the model's pose might as well be another, shape (k, n).
        """


@dataclass(frozen=True, kw_only=True)
class Models:
    """The current models of a run, as genomes with weights.

    Attributes:
        genes: Shape (n, genes), each in [0, 1].
        weights: Adding up to 1, shape (n,).
        scales: Logarithms of the factors on tilt's and clearance's noise, shape (n, 2); 0 where a
            method knows none.
        doubts: Bodies that depart from the problem and explain the readings as well, once a method
            is sure of the models.
    """

    genes: Array
    weights: Array
    scales: Array
    doubts: tuple[Doubt, ...] = ()

    @classmethod
    def equally_likely(cls, genes: Array) -> Models:
        """Models that are as good as each other."""
        count = len(genes)
        return cls(genes=genes, weights=np.full(count, 1 / count), scales=np.zeros((count, 2)))

    def sample(self, count: int, rng: np.random.Generator) -> Models:
        """At most ``count`` equally likely models, drawn by their weights."""
        rows = systematic(self.weights, min(count, len(self.weights)), float(rng.random()))
        return Models(
            genes=self.genes[rows],
            weights=np.full(len(rows), 1 / len(rows)),
            scales=self.scales[rows],
            doubts=self.doubts,
        )


@dataclass(frozen=True, kw_only=True)
class Situation:
    """All that is known when a motor program is to be chosen.

    Attributes:
        problem: What is known about the robot beforehand.
        capabilities: What the robot says of itself.
        modalities: Sensors that count.
        observations: Of the interactions so far.
        models: What is believed by now; random ones before the first interaction.
        objective: By what the method ``paper`` fits models; the method ``posterior`` has its own
            likelihood.
        physics: Predicts what models feel.
        clearance_cap: Range of the distance sensor, m.
        rng: The choice's own.
        jobs: Threads that the rule may use, apart from those of physics; what it chooses must not
            depend on it.
    """

    problem: Problem
    capabilities: Capabilities
    modalities: tuple[str, ...]
    observations: tuple[Observation, ...]
    models: Models
    objective: Objective
    physics: ArrayMarginPhysics
    clearance_cap: float
    rng: np.random.Generator
    jobs: int = 1

    @cached_property
    def bodies(self) -> Bodies:
        """The bodies of the models, in their order."""
        genome = Genome(self.problem, self.problem.base(self.capabilities))
        return genome.bodies(self.models.genes)

    def predict(self, program: Program) -> Readings:
        """What each model feels after a motor program."""
        return self.physics.read_bodies(self.bodies, np.array(program))

    def random_programs(self, count: int) -> list[Program]:
        """Motor programs as the paper draws them: every target from the problem's range."""
        drawn = [self.problem.random_program(self.rng, self.capabilities) for _ in range(count)]
        return [tuple(program.tolist()) for program in drawn]


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A motor program, and why it was chosen.

    Attributes:
        program: Target angle of each joint, rad.
        reason: For people, as the rest of a sentence; empty where there is none.
        bits: Information about the body that it is expected to give, where the rule knows.
    """

    program: Program
    reason: str = ""
    bits: float | None = None
