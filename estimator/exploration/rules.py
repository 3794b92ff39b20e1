"""Exploration rules: which motor program the robot performs next, and what a rule is given.

A rule of another package belongs to the entry-point group ``bodyschema.exploration``.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Protocol

import numpy as np

from estimator.body.morphology import Array
from estimator.plugins import Registry
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.model.sensor_data import DENSITIES, SCALED
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Program
from estimator.storage.run_config import Learn


@dataclass(frozen=True, kw_only=True)
class Situation:
    """All that is known when a motor program is to be chosen.

    Attributes:
        posterior: What is known of the body by now, and the interactions that it was learnt from;
            random bodies before the first. With the method ``paper`` it holds the population.
        rng: Random generator of this choice alone.
        learn: What is to be learnt once attachments have converged.
        jobs: Threads that the rule may use, apart from those of physics; what it chooses must not
            depend on it.
    """

    posterior: FittedPosterior
    rng: np.random.Generator
    learn: Learn = "all"
    jobs: int = 1

    def random_programs(self, count: int) -> list[Program]:
        """So many motor programs as the paper draws them: every target from the problem's range."""
        problem, robot = self.posterior.problem, self.posterior.capabilities
        drawn = [problem.random_program(self.rng, robot) for _ in range(count)]
        return [tuple(program.tolist()) for program in drawn]


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A motor program, and why it was chosen.

    Attributes:
        program: Target angle of each joint, rad.
        reason: Why, for people, as the rest of a sentence; empty where no reason is given.
        bits: Expected information about the body, bits; ``None``: the rule does not know it.
        bits_about_causes: Expected information about which of the competing causes it is, were
            these nearly even, bits; 0: no movement was asked for that tells it.
    """

    program: Program
    reason: str = ""
    bits: float | None = None
    bits_about_causes: float = 0.0


class Rule(Protocol):
    """Chooses motor programs; any function of this form will do."""

    def __call__(self, situation: Situation) -> Choice:
        """Chooses the motor program to perform next, by all that is known by now."""


def random_program(situation: Situation) -> Choice:
    """The paper's rule: every target drawn from the problem's range."""
    (program,) = situation.random_programs(1)
    return Choice(program=program)


CANDIDATES: Final = 300  # random programs that ``disagreement`` compares
MODELS: Final = 64  # models by which it compares them
_SATURATED: Final = 10.0  # standard deviations: larger distances count as this one


def most_disputed_program(situation: Situation) -> Choice:
    """Maximises the mean distance between the readings that pairs of models predict.

    Distances are in units of the announced noise and saturate, so that one wild prediction does
    not outweigh many that differ.
    """
    models = situation.posterior.sample(MODELS, situation.rng)
    noise = models.noise
    programs = situation.random_programs(CANDIDATES)
    spread = np.zeros(CANDIDATES)
    for index, program in enumerate(programs):
        readings = models.predict(program)
        columns: list[Array] = []
        for name in DENSITIES:
            if name in models.modalities:
                values = MODALITIES[name].predicted(readings).T
                columns += list(values / noise.of(name) if name in SCALED else _SATURATED * values)
        spread[index] = sum(_mean_distance(values) for values in columns)
    winner = int(np.argmax(spread))
    return Choice(
        program=programs[winner],
        reason=f"its models differ by {spread[winner]:.1f} standard deviations in sum",
    )


def _mean_distance(values: Array) -> float:
    distances = np.abs(values[:, None] - values[None, :])
    return float(np.mean(np.minimum(distances, _SATURATED)))


RULES: Final[Registry[Rule]] = Registry(
    kind="exploration rule",
    group="bodyschema.exploration",
    own=MappingProxyType(
        {
            "information": "estimator.exploration.information:most_informative_program",
            "disagreement": "estimator.exploration.rules:most_disputed_program",
            "random": "estimator.exploration.rules:random_program",
        }
    ),
)
