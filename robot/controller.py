"""The control loop: the only thread that touches devices.

The server's thread calls ``submit``, ``silence`` and ``snapshot``, which never wait for a device;
the control thread takes jobs from a queue and reports through ``events``. What a request may do in
which state is ``protocol.transitions.TRANSITIONS``. Requests that end a motion (hold, relax, stop)
and the controller's silence leave an *interrupt*, which the motion meets before its next serial
line.

A fault ends all that waits in the queue, too: after it the robot does nothing until a ``clear`` has
found every device in order. Until then, and when it has not, the state remains ``fault``.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial

from protocol.capabilities import Capabilities
from protocol.errors import RobotError
from protocol.messages import Observation, Ok, Perform, Read
from protocol.robot import FinalReply, Finished, Progressed, RobotEvent, RobotRequest, Snapshot
from protocol.states import State
from protocol.transitions import REFUSALS, TRANSITIONS, Event
from robot.errors import DeviceError
from robot.interaction import Aborted, Interaction, Outcome
from robot.jobs import INTERRUPTS, NEWS, SENTENCES, STOPPED, Job, ended_by
from robot.notify import ServiceManager

_RARELY = 86_400.0  # s; a wait that needs no end
PROGRESS_PERIOD = 0.1  # s of robot time between progress messages of one phase


class Controller:
    """Carries out requests, one at a time, on its own thread.

    Args:
        interaction: The devices and the choreography of one interaction.
        capabilities: What ``hello`` answers.
        housekeeping: Seconds between checks of the board while idle, or ``None`` for none (in
            virtual time, which stands still while the robot is idle).
        log: Where to write what a person may want to know.
        manager: Who is told that the control loop turns, and what became of the robot.
    """

    def __init__(
        self,
        interaction: Interaction,
        *,
        capabilities: Capabilities,
        housekeeping: float | None,
        log: logging.Logger,
        manager: ServiceManager | None = None,
    ):
        self.capabilities = capabilities
        self._interaction = interaction
        self._housekeeping = housekeeping
        self._log = log
        self._manager = manager or ServiceManager({})
        self._lock = threading.Lock()
        self._state = State.RELAXED if interaction.limp else State.IDLE
        self._reason: str | None = None
        self._motion: Job | None = None  # the last motion that was accepted and has not ended
        self._faults = 0
        self._stops = 0
        self._leaving = False
        self._sequence = 0
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._events: deque[RobotEvent] = deque()
        self._notify: Callable[[], None] = lambda: None
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)

    # --- called by the server's thread ------------------------------------------------------------

    def set_notify(self, notify: Callable[[], None]) -> None:
        """``notify`` is called, from any thread, when events wait."""
        self._notify = notify

    def submit(self, ticket: int, request: RobotRequest) -> None:
        """Takes a request; its end comes as a ``Finished`` event.

        Raises:
            RobotError: The request is refused.
        """
        event = Event(request.TYPE)
        with self._lock:
            if self._leaving:
                self._submit_late(ticket, request)
                return
            before = self._state
            following = TRANSITIONS.get((self._state, event))
            if following is None:
                raise self._refusal(event)
            job = Job(ticket, request, before, self._faults, self._stops)
            if event is Event.PERFORM:
                self._motion = job
            elif self._motion is not None and event in INTERRUPTS:
                self._motion.interrupt = INTERRUPTS[event]
            if job.clears(State.FAULT):
                following = before  # until the devices are found in order
            elif event is Event.STOP:
                self._reason = self._reason or STOPPED
                self._stops += 1
            elif event in (Event.CLEAR, Event.PERFORM):
                self._reason = None
            self._state = following
            self._jobs.put(job)
        if following is not before:
            self._tell_news(request)

    def _submit_late(self, ticket: int, request: RobotRequest) -> None:
        """While the robot parks: only a stop is for it, and ends that motion, too."""
        if request.TYPE != Event.STOP:
            raise ended_by("shutting_down")
        self._state = TRANSITIONS[self._state, Event.STOP]
        self._reason = STOPPED
        self._tell_news(request)
        # Answered here: the control thread takes no more jobs, or has ended.
        reply = Ok(id=request.id, state=self._state)
        self._emit(Finished(ticket=ticket, reply=reply))

    def controller_changed(self, client: str | None) -> None:
        """The next zero pose is the new controller's reference for lying flat."""
        del client
        self._interaction.forget_flat()

    def silence(self) -> None:
        """The controller fell silent: a motion ends, and the robot holds."""
        self._end_motion("aborted_silent")

    def snapshot(self) -> Snapshot:
        """What the robot is doing at this moment."""
        with self._lock:
            return Snapshot(
                state=self._state,
                robot_time=self._interaction.now(),
                sequence=self._sequence,
                angles=self._interaction.angles(),
                reason=self._reason,
            )

    def events(self) -> list[RobotEvent]:
        """What happened since the last call."""
        found: list[RobotEvent] = []
        while self._events:
            found.append(self._events.popleft())
        return found

    # --- life -------------------------------------------------------------------------------------

    def start(self) -> None:
        """Starts the control thread."""
        self._thread.start()

    def shut_down(self, timeout: float = 5.0) -> bool:
        """Ends a motion, parks at zero where the state allows it, ends the control thread.

        A stopped, faulty or limp robot is left as it is: parking would move it. From now on every
        request but ``stop`` is refused, and that one ends the parking, too.

        Returns:
            Whether the thread ended in time.
        """
        with self._lock:
            self._leaving = True
        self._end_motion("shutting_down")
        self._jobs.put(None)
        self._thread.join(timeout)
        return not self._thread.is_alive()

    # --- the control thread -----------------------------------------------------------------------

    def _run(self) -> None:
        while (job := self._next_job()) is not None:
            self._guarded(partial(self._carry_out, job), job)
        self._guarded(self._park)

    def _next_job(self) -> Job | None:
        """Waits for work; meanwhile looks after the board and shows that the loop turns."""
        due = time.monotonic() + (self._housekeeping or _RARELY)
        while True:
            self._manager.alive()
            patience = min(due - time.monotonic(), self._manager.period or _RARELY)
            with suppress(queue.Empty):
                return self._jobs.get(timeout=max(patience, 0.0))
            if self._housekeeping is not None and time.monotonic() >= due:
                self._guarded(self._check_board)
                due = time.monotonic() + self._housekeeping

    def _guarded(self, action: Callable[[], None], job: Job | None = None) -> None:
        try:
            action()
        except DeviceError as error:
            self._fail(str(error), job)
        except Exception as error:  # a bug must bring the robot down visibly, not silently
            self._log.exception("the control loop failed")
            self._fail(f"internal error: {error!r}", job)

    def _carry_out(self, job: Job) -> None:
        request = job.request
        with self._lock:
            overtaken = job.faults != self._faults and request.TYPE != Event.STOP
            sentence = f"The robot went down before this was done: {self._reason}"
            too_late = self._leaving and isinstance(request, Perform | Read)
            stopped = job.stops != self._stops
        if overtaken:
            self._finish(job, job.error(RobotError("fault", sentence)))
        elif too_late:
            self._finish(job, job.error(ended_by("shutting_down")))
        elif isinstance(request, Perform):
            self._finish(job, self._perform(job, request.targets))
        elif request.TYPE == Event.READ:
            self._finish(job, self._read(job))
        else:
            if request.TYPE == Event.RELAX:
                self._interaction.relax()
            elif job.clears(State.FAULT):
                self._recover(job)
            elif not stopped and (request.TYPE == Event.HOLD or job.clears(State.STOPPED)):
                self._interaction.hold()  # also when it was limp: that must not move after a stop
            self._finish(job, Ok(id=request.id, state=self.snapshot().state))

    def _perform(self, job: Job, targets: Mapping[str, float]) -> FinalReply:
        def report(phase: str, fraction: float) -> None:
            wanted = Event.ARRIVED if phase in ("settling", "sampling") else Event.DEPARTED
            with self._lock:
                if job.interrupt is not None:
                    raise Aborted(job.interrupt)
                self._state = TRANSITIONS.get((self._state, wanted), self._state)
            self._progress(job, phase, fraction)

        outcome: Outcome | RobotError
        try:
            outcome = self._interaction.perform(targets, report)
        except Aborted as error:
            outcome = ended_by(error.code)
        except RobotError as error:
            outcome = error
        with self._lock:
            if job.interrupt is not None:  # maybe since the last report
                outcome = ended_by(job.interrupt)
            if self._motion is job:
                self._motion = None
                self._state = TRANSITIONS.get((self._state, Event.DONE), self._state)
        if isinstance(outcome, RobotError):
            return job.error(outcome)
        return self._observation(job, outcome)

    def _read(self, job: Job) -> FinalReply:
        def report(phase: str, fraction: float) -> None:
            with self._lock:
                if self._leaving:
                    raise Aborted("shutting_down")
            self._progress(job, phase, fraction)

        try:
            return self._observation(job, self._interaction.read(report))
        except Aborted as error:
            return job.error(ended_by(error.code))

    def _progress(self, job: Job, phase: str, fraction: float) -> None:
        now = self._interaction.now()
        last_phase, last_time = job.reported
        if phase != last_phase or now - last_time >= PROGRESS_PERIOD:
            job.reported = (phase, now)
            self._emit(
                Progressed(ticket=job.ticket, phase=phase, fraction=fraction, robot_time=now)
            )

    def _recover(self, job: Job) -> None:
        with self._lock:
            if self._state is not State.FAULT:  # an earlier clear did it
                return
        self._interaction.recover()
        with self._lock:
            stopped = job.stops != self._stops  # a stop that comes after a clear outlasts it
            self._state = State.STOPPED if stopped else TRANSITIONS[self._state, Event.CLEAR]
            self._reason = STOPPED if stopped else None
        self._tell_news(job.request)

    def _observation(self, job: Job, outcome: Outcome) -> Observation:
        with self._lock:
            self._sequence += 1
            sequence = self._sequence
        return job.observation(outcome, sequence, self._interaction.angles())

    def _check_board(self) -> None:
        with self._lock:
            waiting = self._state not in (State.MOVING, State.SETTLING, State.FAULT)
        if waiting:
            self._interaction.check_board()

    def _park(self) -> None:
        with self._lock:
            calm = self._state in (State.IDLE, State.HOLDING)
            state = self._state
        if not calm:
            self._log.info("not parked: the robot is %s", state)
            return

        def unless_stopped(phase: str, fraction: float) -> None:
            del phase, fraction
            with self._lock:
                if self._state is State.STOPPED:
                    raise Aborted("aborted_stop")

        try:
            self._interaction.park(unless_stopped)
        except Aborted:
            self._log.warning("not parked: %s", SENTENCES["aborted_stop"])
        else:
            self._log.info("parked")

    def _end_motion(self, code: str) -> None:
        with self._lock:
            if self._motion is not None and self._state in (State.MOVING, State.SETTLING):
                self._motion.interrupt = code
                self._state = TRANSITIONS[self._state, Event.HOLD]
                self._reason = SENTENCES[code]

    def _fail(self, sentence: str, job: Job | None) -> None:
        self._announce(logging.ERROR, f"fault: {sentence}")
        with self._lock:
            self._motion = None
            self._faults += 1
            self._state = TRANSITIONS[self._state, Event.FAILED]
            self._reason = sentence[:500]
        if job is not None:
            self._finish(job, job.error(RobotError("fault", sentence)))

    def _tell_news(self, request: RobotRequest) -> None:
        if (news := NEWS.get(Event(request.TYPE))) is not None:
            level, sentence = news
            self._announce(level, sentence.format(request.client))

    def _announce(self, level: int, sentence: str) -> None:
        self._log.log(level, "%s", sentence)
        self._manager.status(sentence)

    def _refusal(self, event: Event) -> RobotError:
        reason = f" ({self._reason})" if self._reason else ""
        return RobotError(
            REFUSALS[self._state], f"The robot is {self._state}{reason}: {event} is refused."
        )

    def _finish(self, job: Job, reply: FinalReply) -> None:
        self._emit(Finished(ticket=job.ticket, reply=reply))

    def _emit(self, event: RobotEvent) -> None:
        self._events.append(event)
        self._notify()
