"""Checks, and the decorator that registers them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Final, TypeAlias

from protocol.conformance.robot_under_test import RobotUnderTest

Run: TypeAlias = Callable[[RobotUnderTest], None]


class Need(Enum):
    """What a check needs beyond a connection."""

    NOTHING = "nothing"
    CONTROL = "control"  # takes control of a robot that is at rest, for a moment
    MOTION = "motion"  # moves it, lets it go limp, or disturbs other clients: only when allowed
    TIME = "time"  # takes half a minute: only when allowed
    KEYS = "keys"  # a robot with keys


@dataclass(frozen=True, kw_only=True)
class Check:
    """One check of one or several clauses.

    Attributes:
        clauses: The clauses of ``SPEC.md`` that it tries.
        title: What is tried, one line.
        need: What the check needs beyond a connection.
        basic: The kind of request that it tries and that other checks need. Such checks come first;
            where one fails, the others do not try this kind of request again.
        after: Clauses that it relies on: where one of them does not hold, it is skipped.
        run: Tries the robot: returns where the clauses hold, raises ``Failed`` or ``Skipped``.
    """

    clauses: tuple[str, ...]
    title: str
    need: Need
    basic: str | None = None
    after: tuple[str, ...] = ()
    run: Run


CHECKS: Final[list[Check]] = []


def check(
    *clauses: str,
    need: Need = Need.NOTHING,
    basic: str | None = None,
    after: tuple[str, ...] = (),
) -> Callable[[Run], Run]:
    """Registers a function as a check; the first line of its docstring is the title."""

    def register(run: Run) -> Run:
        title = (run.__doc__ or "").strip().splitlines()[0].rstrip(".")
        CHECKS.append(
            Check(clauses=clauses, title=title, need=need, basic=basic, after=after, run=run)
        )
        return run

    return register
