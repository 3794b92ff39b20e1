"""Exceptions with which a check reports that a clause does not hold or cannot be tried."""

from __future__ import annotations


class Broken(Exception):  # noqa: N818 - a verdict on somebody else's program
    """A clause does not hold.

    Args:
        sentence: What the robot did instead.
        clause: The clause that does not hold, where it is another one than the check tries.
    """

    def __init__(self, sentence: str, clause: str | None = None):
        super().__init__(sentence)
        self.clause = clause


class Untried(Exception):  # noqa: N818 - likewise
    """A clause could not be tried; the message says why."""


def expect(condition: bool, sentence: str, clause: str | None = None) -> None:
    """Raises ``Broken`` with the sentence and clause, unless the condition holds."""
    if not condition:
        raise Broken(sentence, clause)
