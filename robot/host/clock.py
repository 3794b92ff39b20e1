"""The robot's clock, passed in wherever time matters, and one that detects jumps of it.

It drives slewing, serial pacing, settling, time stamps and conversion deadlines. On a robot it is
the wall clock; a simulated robot brings a virtual one, which advances only when somebody sleeps
or a device is touched. Time-outs of sockets and of the service manager belong to the wall clock
and do not come here.

The kernel's monotonic clock neither jumps nor runs backwards, but a control loop can stand still
(a stopped process, a suspended computer), which looks the same from inside; and a virtual clock
does what it is told. After such a jump a motion would command a leap, and an observation would
carry a wrong time: ``SteadyClock`` detects it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Final, Protocol

from robot.errors import DeviceDataError


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


MAX_GAP: Final = 2.0
"""Seconds between two looks at the clock during a motion that are no longer ordinary delay."""


class SteadyClock:
    """A clock that never runs backwards, and that detects jumps of the clock below.

    Args:
        clock: The robot clock.
    """

    def __init__(self, clock: Clock):
        self._clock = clock
        self.sleep = clock.sleep
        self.charge = clock.charge
        self._lock = threading.Lock()  # the server's thread asks for the time, too
        self._last = clock.now()
        self._lost = 0.0
        self._backwards = 0.0
        self._looked_at = self._last

    def now(self) -> float:
        """Seconds that only grow."""
        with self._lock:
            time = self._clock.now()
            step_back = max(0.0, self._last - time)
            self._last = time
            self._lost += step_back
            self._backwards += step_back
            return time + self._lost

    def watch(self) -> None:
        """Starts to look for jumps: something begins that a jump would spoil."""
        self._looked_at = self.now()
        self._backwards = 0.0

    def check(self, at_most: float = MAX_GAP) -> None:
        """Checks for a jump since the last call; to be called again and again meanwhile.

        Args:
            at_most: Seconds that may have passed since the last call, or since ``watch``.

        Raises:
            DeviceDataError: More time passed than that, or time ran backwards.
        """
        gap = self.now() - self._looked_at
        backwards = self._backwards
        self.watch()
        jump = -backwards if backwards else gap
        if backwards or gap > at_most:
            raise DeviceDataError(
                f"The robot clock jumped by {jump:+.1f} s in mid-motion.",
                "Find out what stopped the daemon or set its clock.",
            )
