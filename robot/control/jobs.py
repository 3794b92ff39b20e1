"""A request on its way through the control loop, its answers, and what they say in words."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Final

from protocol.errors import CLEAR, RobotError
from protocol.rules.transitions import Event
from protocol.wire.messages import ErrorReply, ObservationReply, RobotRequest
from robot.sensing.sensors import Reading

SENTENCES: Final = MappingProxyType(
    {
        "aborted_read": "A command of the controller ended the read.",
        "aborted_hold": "A hold request ended the motion.",
        "aborted_relax": "A relax request ended the motion.",
        "aborted_stop": "A stop request came before this was done; the robot is frozen.",
        "shutting_down": "The daemon is shutting down.",
    }
)
"""What the codes mean with which a request ends that was interrupted."""

_READ = MappingProxyType({Event.READ: "aborted_read"})

ENDS: Final = MappingProxyType(
    {
        Event.PERFORM: _READ,
        Event.READ: MappingProxyType({}),
        Event.HOLD: _READ | {Event.PERFORM: "aborted_hold"},
        Event.RELAX: _READ | {Event.PERFORM: "aborted_relax"},
        Event.CLEAR: _READ,
        Event.STOP: dict.fromkeys(
            (Event.READ, Event.PERFORM, Event.HOLD, Event.RELAX, Event.CLEAR), "aborted_stop"
        ),
    }
)
"""What each request ends that was accepted before it, and the error code with which that ends."""

LEAVING: Final = MappingProxyType({Event.READ: "shutting_down", Event.PERFORM: "shutting_down"})
"""What the end of the daemon ends, and the error code with which that ends."""

STOPPED: Final = "A client sent stop."
OFF: Final = (
    "The servos get no pulses, as after power-up. Put each joint at 0° by hand and keep clear: a "
    "hold request switches them on, and each jumps to 0°."
)

NEWS: Final = MappingProxyType(
    {
        Event.STOP: (logging.WARNING, f"stopped by client {{}}; frozen until: {CLEAR}"),
        Event.RELAX: (logging.WARNING, "limp; relaxed by client {}"),
        Event.CLEAR: (logging.INFO, "cleared by client {}"),
    }
)
"""What a person wants to know afterwards: level, and a sentence about a client."""


PROGRESS_PERIOD: Final = 0.1
"""Seconds of robot time between progress messages of one phase."""


@dataclass(eq=False)
class Job:
    """One request that was accepted.

    Attributes:
        ticket: Ties its events to it.
        request: What was asked.
        interrupt: The error with which it shall end.
        reported: Phase and robot time of the last progress that was told.
        ended: Whether its final reply was given, or nobody waits for one.
    """

    ticket: int
    request: RobotRequest
    interrupt: RobotError | None = None
    reported: tuple[str, float] = ("", 0.0)
    ended: bool = False

    @cached_property
    def event(self) -> Event:
        """The event of the request in the table of transitions."""
        return Event(self.request.TYPE)

    def progresses(self, phase: str, now: float) -> bool:
        """Records progress, and returns whether clients should be told.

        Args:
            phase: As in ``protocol.wire.messages.Progress``.
            now: Robot time, s.
        """
        last_phase, last_time = self.reported
        if phase == last_phase and now - last_time < PROGRESS_PERIOD:
            return False
        self.reported = (phase, now)
        return True

    def observation(
        self, reading: Reading, sequence: int, angles: Mapping[str, float]
    ) -> ObservationReply:
        """The reply to a request that measured something; ``angles`` are the joints', rad."""
        return ObservationReply(
            id=self.request.id,
            sequence=sequence,
            monotonic=time.monotonic(),
            angles=angles,
            **vars(reading),
        )

    def error(self, error: RobotError) -> ErrorReply:
        """The reply to a request that failed."""
        return ErrorReply.of(error, request_id=self.request.id)


def ended_by(code: str) -> RobotError:
    """The error with which a request ends that was interrupted, or came too late."""
    return RobotError(code, SENTENCES[code])
