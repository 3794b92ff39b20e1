"""Requests on their way through the control loop, and their answers.

Commands are carried out as they came, then reads as they came; answers to commands go out before
those to reads, of which a stop may have ended very many.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Final

from protocol.errors import CLEAR, RobotError
from protocol.rules.robot_interface import FinalReply, Finished, Progressed, RobotEvent
from protocol.rules.transitions import REFUSALS, TRANSITIONS, Event
from protocol.wire.messages import ErrorReply, ObservationReply, Read, RobotRequest, State
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
"""Sentences for the error codes with which interrupted requests end."""

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
"""By request, the earlier requests that it ends, and the error codes with which these end."""

LEAVING: Final = (Event.READ, Event.PERFORM)
"""Requests that the end of the daemon ends, with ``shutting_down``."""

STOPPED: Final = "A client sent stop."
OFF: Final = (
    "The servos get no pulses, as after power-up. Put each joint at 0° by hand and keep clear: a "
    "hold request switches them on, and each jumps to 0°."
)

LIMP: Final = "The servos are limp, as after power-up. A hold request holds each joint where it is."

NEWS: Final = MappingProxyType(
    {
        Event.STOP: (logging.WARNING, f"stopped by client {{}}; frozen until: {CLEAR}"),
        Event.RELAX: (logging.WARNING, "limp; relaxed by client {}"),
        Event.CLEAR: (logging.INFO, "cleared by client {}"),
    }
)
"""Log level and sentence about a client, by the event that a person wants to know of."""


PROGRESS_PERIOD: Final = 0.1
"""Seconds of robot time between progress messages of one phase."""


@dataclass(eq=False)
class Job:
    """One request that was accepted.

    Attributes:
        ticket: Number that ties events to the request.
        request: The request.
        interrupt: The error with which it shall end, or ``None``.
        reported: Phase and robot time (s) of the last progress that was told.
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


def refused(state: State, event: Event, reason: str | None) -> RobotError:
    """The error for a request that a state forbids; ``reason`` says why the robot is in it."""
    because = f" ({reason})" if reason else ""
    return RobotError(REFUSALS[state], f"The robot is {state}{because}: {event} is refused.")


class JobQueue:
    """The requests that were accepted and have not ended; not thread-safe.

    Attributes:
        under_way: The request that is being carried out, or ``None``.
    """

    def __init__(self) -> None:
        self.under_way: Job | None = None
        self._commands: deque[Job] = deque()
        self._reads: deque[Job] = deque()

    def __bool__(self) -> bool:
        """Whether any request is waiting."""
        return bool(self._commands or self._reads)

    @property
    def stops(self) -> bool:
        """Whether a ``stop`` is waiting."""
        return any(job.event is Event.STOP for job in self._commands)

    def put(self, job: Job) -> None:
        """Appends a request to those of its kind."""
        (self._reads if job.event is Event.READ else self._commands).append(job)

    def take(self) -> Job | None:
        """Removes the next request, which is under way from now on; ``None`` if none is waiting."""
        waiting = self._commands or self._reads
        self.under_way = waiting.popleft() if waiting else None
        return self.under_way

    def end(self, errors: Mapping[Event, RobotError]) -> list[Job]:
        """Ends requests of some kinds with an error: at the next check, or now if they wait.

        Returns:
            The requests that waited, in order; their clients have yet to be told.
        """
        if self.under_way is not None and self.under_way.interrupt is None:
            self.under_way.interrupt = errors.get(self.under_way.event)
        withdrawn = [job for job in self._commands if job.event in errors]
        self._commands = deque(job for job in self._commands if job.event not in errors)
        if Event.READ in errors:
            withdrawn += self._reads
            self._reads = deque()
        for job in withdrawn:
            job.interrupt = errors[job.event]
        return withdrawn

    def overtake(self, event: Event) -> list[Job]:
        """Ends what a request of this kind ends (``ENDS``); returns what ``end`` returns."""
        return self.end({ended: ended_by(code) for ended, code in ENDS[event].items()})

    def leave(self) -> list[Job]:
        """Ends what the end of the daemon ends; returns what ``end`` returns."""
        return self.end({ended: ended_by("shutting_down") for ended in LEAVING})

    def fail(self, error: RobotError) -> list[Job]:
        """Ends all but stops, with one error; returns what ``end`` returns."""
        return self.end(dict.fromkeys(ENDS[Event.STOP], error))

    def leads_to(self, state: State) -> State:
        """The state of the robot once all accepted requests are done.

        A fault lasts until the devices are found in order, so a ``clear`` that has yet to see to
        that does not count; neither does the rest of a motion that was interrupted.

        Args:
            state: The robot's state now.
        """
        for job in (self.under_way, *self._commands):
            if job is None or state is State.FAULT:
                continue
            event = Event.DONE if job.interrupt is not None else job.event
            state = TRANSITIONS.get((state, event), state)
        return state


AT_A_TIME: Final = 64
"""Most events that are taken out at once, so that the server soon looks at requests again."""


class Outbox:
    """A queue of events, filled by any thread and emptied by the server's.

    Attributes:
        notify: Called, from any thread, when events wait.
    """

    def __init__(self) -> None:
        self.notify: Callable[[], None] = lambda: None
        self._lock = threading.Lock()
        self._of_commands: deque[RobotEvent] = deque()
        self._of_reads: deque[RobotEvent] = deque()

    def finish(self, job: Job, reply: FinalReply) -> None:
        """Adds the reply with which a request ended, unless it has one: a fault came before."""
        with self._lock:
            if job.ended:
                return
            job.ended = True
        self._put(job, Finished(ticket=job.ticket, reply=reply))

    def progress(self, job: Job, phase: str, fraction: float, now: float) -> None:
        """Adds progress at robot time ``now`` (s), unless some was added a moment before."""
        last_phase, last_time = job.reported
        if job.ended or (phase == last_phase and now - last_time < PROGRESS_PERIOD):
            return
        job.reported = (phase, now)
        self._put(
            job, Progressed(ticket=job.ticket, phase=phase, fraction=fraction, robot_time=now)
        )

    def withdraw(self, jobs: Sequence[Job]) -> None:
        """Adds, for each request that was ended while it waited, the error with which it ends."""
        for job in jobs:
            assert job.interrupt is not None
            self.finish(job, job.error(job.interrupt))

    def take(self) -> list[RobotEvent]:
        """Removes up to ``AT_A_TIME`` events; notifies again if others are left."""
        taken: list[RobotEvent] = []
        while waiting := self._of_commands or self._of_reads:
            if len(taken) == AT_A_TIME:
                self.notify()
                break
            taken.append(waiting.popleft())
        return taken

    def _put(self, job: Job, event: RobotEvent) -> None:
        (self._of_reads if isinstance(job.request, Read) else self._of_commands).append(event)
        self.notify()
