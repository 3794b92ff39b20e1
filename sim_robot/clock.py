"""The clocks of a simulated robot: whoever sleeps moves the world.

Both wait, before they let time pass, until the emulated servo board has read every byte that was
written to it: otherwise a command could take effect before or after it was due, by the luck of the
operating system's scheduling.
"""

from __future__ import annotations

import time
from collections.abc import Callable

MAX_SLICE = 0.02  # s of real time between two advances of a real-time world


class VirtualClock:
    """Time that advances only when the control loop sleeps or a device is touched.

    Args:
        advance: Brings the world to a time, s.
    """

    def __init__(self, advance: Callable[[float], None]):
        self._advance = advance
        self._now = 0.0
        self.synchronise: Callable[[], None] = lambda: None

    def now(self) -> float:
        """Virtual time, s."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Lets the world go on by ``seconds``."""
        if seconds <= 0:
            return
        deadline = self._now + seconds
        self.synchronise()
        self._now = max(self._now, deadline)
        self._advance(self._now)

    def charge(self, seconds: float) -> None:
        """Adds the time of a device access; the world catches up at the next sleep."""
        self._now += seconds


class RealTimeClock:
    """The wall clock, with the world following it.

    Args:
        advance: Brings the world to a time, s.
    """

    def __init__(self, advance: Callable[[float], None]):
        self._advance = advance
        self._start = time.monotonic()
        self.synchronise: Callable[[], None] = lambda: None

    def now(self) -> float:
        """Seconds since the clock was made."""
        return time.monotonic() - self._start

    def sleep(self, seconds: float) -> None:
        """Blocks for ``seconds`` while the world goes on."""
        deadline = self.now() + seconds
        self.synchronise()
        while (left := deadline - self.now()) > 0:
            self._advance(self.now())
            time.sleep(min(left, MAX_SLICE))
        self._advance(self.now())

    def charge(self, seconds: float) -> None:
        """Does nothing: the time has really passed."""
