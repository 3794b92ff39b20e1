"""How a check says that a clause does not hold, or could not be tried."""

from __future__ import annotations


class Broken(Exception):  # noqa: N818 - a verdict on somebody else's program
    """A clause does not hold; the message says what the robot did instead."""


class Untried(Exception):  # noqa: N818 - likewise
    """A clause could not be tried; the message says why."""


def expect(condition: bool, sentence: str) -> None:
    """Raises ``Broken`` with the sentence, unless the condition holds."""
    if not condition:
        raise Broken(sentence)
