"""Limits how often events of the same kind are logged."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Final

PERIOD: Final = 60.0


class LogLimiter:
    """Lets one event of a kind through, then at most one in each period, and counts the others.

    It remembers every kind, so there must be a bounded number of them.

    Args:
        period: Shortest time between two events of a kind that are let through, s.
    """

    def __init__(self, period: float = PERIOD):
        self._period = period
        self._kinds: dict[Hashable, tuple[float, int]] = {}

    def count(self, kind: Hashable, now: float) -> int | None:
        """Counts an event that happened at ``now`` (s).

        Returns:
            How many of its kind were kept back since the last one that was let through, or
            ``None`` when this one is kept back too.
        """
        since, kept_back = self._kinds.get(kind, (-float("inf"), 0))
        if now - since < self._period:
            self._kinds[kind] = since, kept_back + 1
            return None
        self._kinds[kind] = now, 0
        return kept_back
