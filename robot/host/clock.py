"""The robot's clock, passed in wherever time matters.

It drives slewing, serial pacing, settling, time stamps and conversion deadlines. On a robot it is
the wall clock; a simulated robot brings a virtual one, which advances only when somebody sleeps
or a device is touched. Time-outs of sockets and of the service manager belong to the wall clock
and do not come here.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol


class Clock(Protocol):
    """Seconds that only grow, from an arbitrary start."""

    def now(self) -> float:
        """The present robot time, s."""

    def sleep(self, seconds: float) -> None:
        """Lets ``seconds`` pass; nothing happens for zero or less."""

    def charge(self, seconds: float) -> None:
        """Accounts for time that a blocking device call took.

        A wall clock saw that time go by and does nothing; a virtual clock adds it.
        """


class WallClock:
    """The machine's monotonic clock."""

    def now(self) -> float:
        """The monotonic clock, s."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Blocks for ``seconds``."""
        if seconds > 0:
            time.sleep(seconds)

    def charge(self, seconds: float) -> None:
        """Does nothing: the time has really passed."""


class WatchedClock:
    """A clock with a callback before each sleep; code that is not stuck sleeps often.

    Args:
        clock: The clock.
        on_sleep: Called before each sleep, by the thread that sleeps.
    """

    def __init__(self, clock: Clock, on_sleep: Callable[[], None]):
        self._clock = clock
        self._on_sleep = on_sleep
        self.now = clock.now
        self.charge = clock.charge

    def sleep(self, seconds: float) -> None:
        """Calls back, then lets ``seconds`` pass."""
        self._on_sleep()
        self._clock.sleep(seconds)
