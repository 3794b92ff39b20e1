"""What an exploration rule is told, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.body.morphology import Array
from estimator.physics.base import ArrayMarginPhysics
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation, Program
from protocol.wire.capabilities import Capabilities


@dataclass(frozen=True, kw_only=True)
class Models:
    """The current models of a run, as genomes with weights.

    Attributes:
        genes: Shape (n, genes), each in [0, 1].
        weights: Adding up to 1, shape (n,).
        scales: Logarithms of the factors on tilt's and clearance's noise, shape (n, 2); 0 where a
            method knows none.
    """

    genes: Array
    weights: Array
    scales: Array

    @classmethod
    def equally_likely(cls, genes: Array) -> Models:
        """Models that are as good as each other."""
        count = len(genes)
        return cls(genes=genes, weights=np.full(count, 1 / count), scales=np.zeros((count, 2)))

    def sample(self, count: int, rng: np.random.Generator) -> Models:
        """At most ``count`` equally likely models, drawn by their weights."""
        rows = rng.choice(len(self.genes), min(count, len(self.genes)), p=self.weights)
        return Models(
            genes=self.genes[rows],
            weights=np.full(len(rows), 1 / len(rows)),
            scales=self.scales[rows],
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
        physics: Predicts what models feel.
        clearance_cap: Range of the distance sensor, m.
        rng: The choice's own.
    """

    problem: Problem
    capabilities: Capabilities
    modalities: tuple[str, ...]
    observations: tuple[Observation, ...]
    models: Models
    physics: ArrayMarginPhysics
    clearance_cap: float
    rng: np.random.Generator


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
