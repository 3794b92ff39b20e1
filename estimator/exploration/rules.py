"""Exploration rules by name: which motor program the robot performs next.

A rule of another package belongs to the entry-point group ``bodyschema.exploration``.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Final, Protocol

from estimator.exploration.situation import Choice, Situation
from estimator.plugins import Registry


class Rule(Protocol):
    """Chooses motor programs; any function of this form will do."""

    def __call__(self, situation: Situation) -> Choice:
        """The motor program to perform next.

        Args:
            situation: All that is known by now.
        """


def random_program(situation: Situation) -> Choice:
    """The paper's rule: every target drawn from the problem's range."""
    (program,) = situation.random_programs(1)
    return Choice(program=program)


RULES: Final[Registry[Rule]] = Registry(
    kind="exploration rule",
    group="bodyschema.exploration",
    own=MappingProxyType(
        {
            "information": "estimator.exploration.information:most_informative_program",
            "disagreement": "estimator.exploration.disagreement:most_disputed_program",
            "random": "estimator.exploration.rules:random_program",
        }
    ),
)
