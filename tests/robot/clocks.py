"""A robot clock for tests that need no control over it."""

from __future__ import annotations


class InstantClock:
    """Stands still unless somebody sleeps on it, which takes no time, or charges it."""

    def __init__(self, start: float = 0.0):
        self._now = start

    def now(self) -> float:
        return self._now

    def sleep(self, seconds: float) -> None:
        self._now += max(seconds, 0.0)

    def charge(self, seconds: float) -> None:
        self._now += seconds
