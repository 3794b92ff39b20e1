"""The clocks of a simulated robot, which advance the world when they are slept on.

Before they let time pass, both call ``synchronise``, which waits until an emulated servo board has
read every byte that was written to it: otherwise a command could take effect before or after it was
due, by the luck of the operating system's scheduling.

``HostClock`` is the clock of the computer that the daemon runs on: it follows one of these, and can
jump, which leaves the world and its electronics untouched.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import ClassVar

from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import Fault, FaultSwitch

TICK = 2.0**-30  # s; differences of its multiples are exact: equal durations stay equal
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
        deadline = self._now + _in_ticks(seconds)
        self.synchronise()
        self._now = max(self._now, deadline)
        self._advance(self._now)

    def charge(self, seconds: float) -> None:
        """Adds the time of a device access; the world catches up at the next sleep."""
        self._now += _in_ticks(seconds)


def _in_ticks(seconds: float) -> float:
    return round(seconds / TICK) * TICK


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
        while (remaining := deadline - self.now()) > 0:
            self._advance(self.now())
            time.sleep(min(remaining, MAX_SLICE))
        self._advance(self.now())

    def charge(self, seconds: float) -> None:
        """Does nothing: the time has really passed."""


class HostClock(FaultSwitch):
    """The clock of the computer that the daemon runs on; a fault can make it jump.

    Args:
        clock: Clock by which the world goes on.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        "jump": Fault(
            "the robot clock jumps by n seconds, which may be negative",
            range(1 - 10**9, 10**9),
            once=True,
        )
    }

    def __init__(self, clock: Clock):
        super().__init__()
        self.sleep = clock.sleep
        self.charge = clock.charge
        self._clock = clock
        self._offset = 0

    def now(self) -> float:
        """Seconds on this clock."""
        return self._clock.now() + self._offset

    def _happen(self, event: str, value: int) -> None:
        self._offset += value
