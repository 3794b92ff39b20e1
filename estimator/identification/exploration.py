"""Exploration rules: which motor program the robot performs next. A new rule gets its row here."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType
from typing import Final, TypeAlias

import numpy as np

from estimator.errors import EstimatorError
from estimator.problem.problem import Problem
from estimator.readings.observation import Program
from protocol.wire.capabilities import Capabilities

Rule: TypeAlias = Callable[[Problem, Capabilities, np.random.Generator], Program]
"""A motor program, rad, for a problem and a robot, from the interaction's own randomness."""


def random_program(
    problem: Problem, capabilities: Capabilities, rng: np.random.Generator
) -> Program:
    """The paper's rule: every target drawn from the problem's range."""
    return tuple(problem.random_program(rng, capabilities).tolist())


_RULES: Final = MappingProxyType({"random": random_program})
RULES: Final = tuple(_RULES)


def rule(name: str) -> Rule:
    """The rule of a given name.

    Raises:
        EstimatorError: There is no such rule.
    """
    if name not in _RULES:
        raise EstimatorError(f"there is no exploration rule {name!r}: choose {', '.join(RULES)}")
    return _RULES[name]
