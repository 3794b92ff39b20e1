"""Settings of the conformance suite: the robot's address, what may be tried, time limits."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from protocol.security.keys import ClientKeys


@dataclass(frozen=True, kw_only=True)
class SuiteSettings:
    """What the suite may do.

    Attributes:
        uri: Where the robot is.
        keys: The suite's keys, or ``None``.
        move: Whether the robot may be moved, and other clients be disturbed.
        slow: Whether to try what takes half a minute.
        far: Whether joints may be moved to the ends of their ranges.
        other_keys: Keys of another client, or ``None``.
        shut_down: Makes the robot's daemon end; ``None``: it may not end.
        patience: Seconds to wait for an answer that must come.
        motion: Seconds that one interaction may take.
        clock: Measures the silences that ``slow`` needs, s.
        trace: Takes each message that is sent or received, in words; ``None``: nobody does.
    """

    uri: str
    keys: ClientKeys | None = None
    move: bool = False
    slow: bool = False
    far: bool = False
    other_keys: ClientKeys | None = None
    shut_down: Callable[[], object] | None = None
    patience: float = 3.0
    motion: float = 120.0
    clock: Callable[[], float] = time.monotonic
    trace: Callable[[str], None] | None = None
