"""The order in which requests are carried out: commands as they came, then reads as they came."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from protocol.errors import RobotError
from protocol.rules.transitions import TRANSITIONS, Event
from protocol.wire.messages import State
from robot.control.jobs import Job


class JobQueue:
    """The requests that were accepted and have not ended; not thread-safe.

    Attributes:
        under_way: The one that is being carried out.
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
            Those that waited, in order; they have yet to be told.
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
