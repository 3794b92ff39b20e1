"""Events on their way to clients: commands first, for a stop may have ended very many reads."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Final

from protocol.rules.robot_interface import FinalReply, Finished, Progressed, RobotEvent
from protocol.wire.messages import Read
from robot.control.jobs import Job

AT_A_TIME: Final = 64
"""Events that are taken out at once, so that the server soon looks at requests again."""


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
        """Adds the reply with which a request ended, unless there was one: a fault came before."""
        with self._lock:
            if job.ended:
                return
            job.ended = True
        self._put(job, Finished(ticket=job.ticket, reply=reply))

    def progress(self, job: Job, phase: str, fraction: float, now: float) -> None:
        """Adds progress at robot time ``now`` (s), unless some was added a moment before."""
        if not job.ended and job.progresses(phase, now):
            self._put(
                job, Progressed(ticket=job.ticket, phase=phase, fraction=fraction, robot_time=now)
            )

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
