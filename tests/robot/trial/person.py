"""Somebody who tries a robot, by a script."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robot.host.clock import Clock
from robot.trial.session import QUIT

Answer = str | float | Callable[[], None]


class Person:
    """Presses keys from a list, waits (a number of seconds), or does something; then leaves."""

    def __init__(self, clock: Clock, script: Sequence[Answer]):
        self.seen: list[str] = []
        self._clock = clock
        self._script = [*script, 0.5]  # time to show what the last key did
        self._until = 0.0

    def key(self) -> str | None:
        if self._clock.now() < self._until:
            return None
        if not self._script:
            return QUIT
        match self._script.pop(0):
            case str(pressed):
                return pressed
            case float(seconds):
                self._until = self._clock.now() + seconds
            case act if callable(act):
                act()
        return None

    def show(self, text: Sequence[str], rows: Sequence[str], *, keep: int) -> None:
        assert rows[keep].startswith(">")
        self.seen.append("\n".join([*text, *rows]))
