"""A request on its way through the control loop, its answers, and what they say in words."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from protocol.errors import RobotError
from protocol.messages import ErrorReply, Observation
from protocol.robot import RobotRequest
from protocol.states import State
from protocol.transitions import Event
from robot.interaction import Outcome

INTERRUPTS: Final = MappingProxyType(
    {
        Event.HOLD: "aborted_hold",
        Event.RELAX: "aborted_relax",
        Event.STOP: "aborted_stop",
    }
)
"""The requests that end a motion, and the error code with which it then ends."""

SENTENCES: Final = MappingProxyType(
    {
        "aborted_hold": "A hold request ended the motion.",
        "aborted_relax": "A relax request ended the motion.",
        "aborted_stop": "A stop request ended the motion; the robot is frozen.",
        "aborted_silent": "The controller was silent for too long; the robot holds its pose.",
        "shutting_down": "The daemon is shutting down.",
    }
)
"""What each of those codes means."""

STOPPED: Final = "A client sent stop."

NEWS: Final = MappingProxyType(
    {
        Event.STOP: (logging.WARNING, "stopped by client {}; frozen until it is cleared"),
        Event.RELAX: (logging.WARNING, "limp; relaxed by client {}"),
        Event.CLEAR: (logging.INFO, "cleared by client {}"),
    }
)
"""What a person wants to know afterwards: level, and a sentence about a client."""


@dataclass(eq=False)
class Job:
    """One request that was accepted.

    Attributes:
        ticket: Ties its events to it.
        request: What was asked.
        before: The robot's state at that moment.
        faults: How many faults had happened when it was submitted; after another it is void.
        stops: How many stops, likewise; a clear does not outlast a later one.
        interrupt: The error code with which it shall end.
        reported: Phase and robot time of the last progress.
    """

    ticket: int
    request: RobotRequest
    before: State
    faults: int
    stops: int
    interrupt: str | None = None
    reported: tuple[str, float] = ("", 0.0)

    def clears(self, state: State) -> bool:
        """Whether it is to bring the robot back from a state."""
        return self.request.TYPE == Event.CLEAR and self.before is state

    def observation(
        self, outcome: Outcome, sequence: int, angles: Mapping[str, float]
    ) -> Observation:
        """Its answer when it measured something; ``angles`` are the joints', rad."""
        reading = outcome.reading
        return Observation(
            id=self.request.id,
            sequence=sequence,
            robot_time=reading.time,
            monotonic=time.monotonic(),
            angles=angles,
            saturated_joints=outcome.saturated_joints,
            touch=reading.touch,
            tilt=reading.tilt,
            clearance=reading.clearance,
            clearance_saturated=reading.clearance_saturated,
            settled=outcome.settled,
            settle_time=outcome.settle_time,
            samples=reading.samples,
        )

    def error(self, error: RobotError) -> ErrorReply:
        """Its answer when it failed."""
        return ErrorReply.of(error, request_id=self.request.id)


def ended_by(code: str) -> RobotError:
    """The error with which a request ends that was interrupted, or came too late."""
    return RobotError(code, SENTENCES[code])
