"""The control loop: the only thread that touches devices.

The server's thread calls ``submit``, ``silence`` and ``snapshot``, which never wait for a device;
the control thread takes jobs from a queue and reports through ``events``. What a request may do in
which state is ``protocol.rules.transitions.TRANSITIONS``; which others it ends is
``robot.control.jobs.ENDS``: those that wait end at once, the one under way is given an *interrupt*,
which ends it before its next line, query or sample. A request is judged by the state to which the
accepted ones lead; a ``snapshot`` shows the state that the devices have reached.

A fault ends all that waits in the queue, too: after it the robot does nothing, and the state
remains ``fault``, until a ``clear`` has found every device in order. Faults are: whatever a driver
raises; a driver that does not return, which a watch reports in the place of the control thread
(that goes no further when the driver does return); and the end of the control thread, after which
nothing moves until the daemon is started again.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from protocol.errors import CLEAR, RobotError, with_address
from protocol.rules.robot_interface import FinalReply, RobotEvent, Snapshot
from protocol.rules.transitions import TRANSITIONS, Event
from protocol.sockets.zmq_sockets import DEFAULT_BIND
from protocol.text import brief, error_text
from protocol.wire.capabilities import Capabilities
from protocol.wire.messages import Ok, Perform, RobotRequest, State
from robot.control.interaction import MotorProgramRunner
from robot.control.jobs import LIMP, NEWS, OFF, STOPPED, Job, JobQueue, Outbox, ended_by, refused
from robot.control.joint_watch import told
from robot.control.watched_thread import WatchedThread
from robot.errors import DeviceError, DriverError
from robot.host.service_manager import ServiceManager
from robot.sensing.sensors import Reading

_LONG_WAIT = 86_400.0  # s; a wait that needs no end
_END_TIMEOUT = 2.0  # s for the control thread to hear that there is no more time
_SLEW_PHASES = ("homing", "moving")  # the phases in which the joints move


class Controller:
    """Carries out requests, one at a time, on its own thread.

    Args:
        interaction: The devices and the choreography of one interaction.
        capabilities: Capabilities with which ``hello`` is answered.
        housekeeping: Seconds between checks of the board while idle, or ``None`` for none (in
            virtual time, which stands still while the robot is idle).
        log: Log for what a person may want to know.
        manager: Service manager; it is told that the control loop turns, and what became of the
            robot.
    """

    def __init__(
        self,
        interaction: MotorProgramRunner,
        *,
        capabilities: Capabilities,
        housekeeping: float | None,
        log: logging.Logger,
        manager: ServiceManager | None = None,
    ):
        self.capabilities = capabilities
        self._address = DEFAULT_BIND
        self._interaction = interaction
        self._housekeeping = housekeeping
        self._log = log
        self._manager = manager or ServiceManager({})
        self._lock = threading.Condition()  # notified when there is work, or no more to come
        self._state = State.RELAXED if interaction.limp else State.IDLE
        limp_reason = LIMP if interaction.measures else OFF
        self._reason = limp_reason if interaction.limp else None
        self._off_target: str | None = None  # the last reason that named joints
        self._leaving = False
        self._late = False
        self._ended = False
        self._fatal_error: RobotError | None = None
        self._sequence = 0
        self._jobs = JobQueue()
        self._outbox = Outbox()
        self._thread = WatchedThread(
            "control",
            self._run,
            seen=lambda: self._manager.heard,
            on_hang=self._give_up,
            on_return=self._returned,
        )

    # --- called by the server's thread ------------------------------------------------------------

    def set_notify(self, notify: Callable[[], None]) -> None:
        """Sets what is called, from any thread, when events are waiting."""
        self._outbox.notify = notify

    def submit(self, ticket: int, request: RobotRequest) -> None:
        """Takes a request; its end comes as a ``Finished`` event.

        Raises:
            RobotError: The request is refused.
        """
        job = Job(ticket, request)
        if job.event is Event.STOP and self._thread.hangs and not self._ended:
            self._stop_blindly(job)
            return
        with self._lock:
            if job.event is not Event.STOP:
                self._refuse_while_down()
            state = self._jobs.leads_to(self._state)
            if (state, job.event) not in TRANSITIONS:
                raise refused(state, job.event, self._reason if state is self._state else None)
            overtaken = self._jobs.overtake(job.event)
            if queued := not self._ended:
                self._jobs.put(job)
                self._lock.notify()
        if not queued:
            self._carry_out(job)  # a stop, and nothing moves any more
        # Only after the control thread has heard of the request, for these may be very many.
        self._outbox.withdraw(overtaken)

    def controller_changed(self, client: str | None) -> None:
        """Another client takes control: the next zero pose is its reference for lying flat."""
        del client
        self._interaction.forget_flat()

    def silence(self, reason: str) -> None:
        """The controlling client has fallen silent: ends a motion; the robot holds."""
        with self._lock:
            overtaken = self._jobs.end({Event.PERFORM: RobotError("aborted_silent", reason)})
        self._outbox.withdraw(overtaken)

    def snapshot(self) -> Snapshot:
        """What the robot is doing at this moment."""
        obstacle = self._thread.obstacle if self._thread.is_late else None
        with self._lock:
            fault = self._state is State.FAULT
            return Snapshot(
                state=self._state,
                robot_time=self._interaction.now(),
                sequence=self._sequence,
                angles=self._interaction.angles(),
                reason=self._reason if fault or obstacle is None else obstacle,
            )

    def events(self) -> list[RobotEvent]:
        """Takes some of the waiting events, in order; calls ``notify`` again if it leaves any."""
        return self._outbox.take()

    # --- life -------------------------------------------------------------------------------------

    def start(self, address: str = DEFAULT_BIND) -> None:
        """Starts the control thread.

        Args:
            address: The robot's address on this computer, for the commands that the log advises.
        """
        self._address = address
        if self._reason is not None:
            self._announce(logging.WARNING, self._reason)
        self._thread.start()

    def shut_down(self, timeout: float = 5.0) -> bool:
        """Ends a motion, parks at zero where the state allows it, ends the control thread.

        A stopped, faulty or limp robot is left as it is: parking would move it. From now on every
        request but ``stop`` is refused; a stop ends the parking, and so does the time-out:
        a robot that needs longer stops on its way.

        Args:
            timeout: Time for the parking, s.

        Returns:
            Whether the thread ended as it should; a driver that does not return is not waited for.
        """
        with self._lock:
            self._leaving = True
            overtaken = self._jobs.leave()
            self._lock.notify()
        self._outbox.withdraw(overtaken)
        if not self._thread.join(timeout):
            with self._lock:
                self._late = True
        return self._thread.join(_END_TIMEOUT) and self._fatal_error is None

    # --- the control thread -----------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._work()
            self._guarded(self._park)
            while not self._ended:
                self._work()  # a stop that came meanwhile
                with self._lock:
                    self._ended = not self._jobs
        except BaseException as error:  # an error of ours: nobody else would ever hear of it
            self._die(error)

    def _die(self, error: BaseException) -> None:
        """Handles an error that ended the control thread: nothing moves, everybody is answered."""
        sentence = f"The control loop has ended: {error_text(error)}."
        with self._lock:
            self._fatal_error = RobotError("fault", sentence, advice="Start the daemon again.")
            self._ended = True
            job = self._jobs.under_way
        self._log.critical("the control loop ended", exc_info=error)
        self._fail(sentence, job)
        while (stop := self._jobs.take()) is not None:
            self._carry_out(stop)

    def _work(self) -> None:
        while (job := self._next_job()) is not None:
            self._guarded(partial(self._carry_out, job), job)

    def _next_job(self) -> Job | None:
        """Waits for work; meanwhile looks after the board and shows that the loop turns."""
        check_at = time.monotonic() + (self._housekeeping or _LONG_WAIT)
        while True:
            self._manager.alive()
            patience = min(check_at - time.monotonic(), self._manager.period or _LONG_WAIT)
            with self._lock:
                if not (self._jobs or self._leaving):
                    self._thread.rest()
                    self._lock.wait(max(patience, 0.0))
                    self._thread.work()
                if self._jobs or self._leaving:
                    return self._jobs.take()
            if self._housekeeping is not None and time.monotonic() >= check_at:
                self._guarded(self._check_board)
                check_at = time.monotonic() + self._housekeeping

    def _guarded(self, action: Callable[[], None], job: Job | None = None) -> None:
        try:
            action()
        except BaseException as error:  # also SystemExit: it must not end the thread in silence
            expected = isinstance(error, DeviceError)
            if not expected or isinstance(error, DriverError):
                self._log.exception("the control loop failed")
            self._fail(str(error) if expected else f"internal error: {error_text(error)}", job)

    def _carry_out(self, job: Job) -> None:
        if job.event in (Event.PERFORM, Event.READ):
            self._outbox.finish(job, self._measure(job))
            return
        old_state = self._state
        try:
            self._interaction.command(job.event, self._state, partial(self._check, job))
        except RobotError:
            event = Event.DONE  # and its interrupt tells why
        else:
            event = job.event
        with self._lock:
            if job.interrupt is not None and job.interrupt.code == "fault":  # given up meanwhile
                event = Event.DONE
            self._enter(event)
            if event in (Event.HOLD, Event.RELAX, Event.CLEAR):
                self._reason = None
            elif event is Event.STOP and self._state is State.STOPPED:
                self._reason = STOPPED
            state = self._state
            self._jobs.under_way = None
        if state is not old_state and event in NEWS:
            level, sentence = NEWS[event]
            self._announce(level, sentence.format(job.request.client))
        aborted = job.interrupt if event is Event.DONE else None
        self._outbox.finish(
            job, job.error(aborted) if aborted else Ok(id=job.request.id, state=state)
        )

    def _measure(self, job: Job) -> FinalReply:
        measured: Reading | RobotError
        report = partial(self._report, job)
        try:
            if isinstance(job.request, Perform):
                measured = self._interaction.perform(job.request.targets, report)
            else:
                measured = self._interaction.read(report)
        except RobotError as error:
            measured = error
        with self._lock:
            self._enter(Event.DONE)
            self._jobs.under_way = None
            if job.interrupt is not None:  # maybe since the last report
                measured = job.interrupt
                if job.event is Event.PERFORM:
                    self._reason = measured.message
            if isinstance(measured, RobotError):
                return job.error(measured)
            self._sequence += 1
            sequence = self._sequence
            angles = self._interaction.angles()
            off_target = told(measured.off_target or {}, measured.measured or {}, angles) or None
            if off_target or self._reason == self._off_target:
                self._reason = self._off_target = off_target
        return job.observation(measured, sequence, angles)

    def _report(self, job: Job, phase: str, fraction: float) -> None:
        self._check(job)
        if job.event is Event.PERFORM:
            with self._lock:
                if job.interrupt is not None:
                    raise job.interrupt
                if self._state not in (State.MOVING, State.SETTLING):
                    self._enter(Event.PERFORM)
                    self._reason = None
                self._enter(Event.DEPARTED if phase in _SLEW_PHASES else Event.ARRIVED)
        self._outbox.progress(job, phase, fraction, self._interaction.now())

    def _check(self, job: Job) -> None:
        self._manager.alive()
        with self._lock:
            if job.interrupt is not None:
                raise job.interrupt

    def _check_board(self) -> None:
        with self._lock:
            sound = self._state is not State.FAULT
        if sound:
            with suppress(RobotError):
                self._interaction.check_board(self._unless_wanted)

    def _unless_wanted(self) -> None:
        self._manager.alive()
        with self._lock:
            if self._jobs or self._state is State.FAULT:  # given up meanwhile
                raise ended_by("aborted_stop")
            if self._late:
                raise RobotError(
                    "shutting_down",
                    "zero is too far off to be reached in time; the servos keep their last "
                    "commands.",
                )

    def _park(self) -> None:
        with self._lock:
            may_park = self._state in (State.IDLE, State.HOLDING)
            state = self._state
        if not may_park:
            self._log.info("not parked: the robot is %s", state)
            return
        try:
            self._interaction.park(self._report_parking)
        except RobotError as error:
            self._log.warning("not parked: %s", error.message)
        else:
            self._log.info("parked")
        with self._lock:
            self._enter(Event.DONE)

    def _report_parking(self, phase: str, fraction: float) -> None:
        del phase, fraction
        self._unless_wanted()
        with self._lock:
            self._enter(Event.PERFORM)

    def _enter(self, event: Event) -> None:
        """Changes the state as the table of transitions says."""
        self._state = TRANSITIONS.get((self._state, event), self._state)

    # --- any thread -------------------------------------------------------------------------------

    def _refuse_while_down(self) -> None:
        """Refuses what the control thread cannot carry out, or need not any more."""
        if self._leaving:
            raise ended_by("shutting_down")
        if self._fatal_error is not None:
            raise self._fatal_error
        if self._thread.hangs:
            raise RobotError("fault", self._thread.obstacle)

    def _stop_blindly(self, job: Job) -> None:
        """Queues a stop for when the loop turns again, and answers at once: not confirmed."""
        error = RobotError("not_confirmed", f"The stop is not confirmed. {self._thread.obstacle}")
        self._outbox.finish(job, job.error(error))
        with self._lock:
            if not self._jobs.stops:  # one is enough, however many ask
                self._jobs.put(job)
                self._lock.notify()

    def _give_up(self) -> None:
        with self._lock:
            job = self._jobs.under_way
        self._fail(self._thread.obstacle, job)

    def _returned(self) -> None:
        self._log.warning("the control loop turns again; the robot stays down")

    def _fail(self, sentence: str, job: Job | None) -> None:
        sentence = brief(sentence)
        job_error = self._fatal_error or RobotError("fault", sentence)
        others_error = RobotError("fault", f"The robot went down before this was done: {sentence}")
        with self._lock:
            self._jobs.under_way = None
            self._state = TRANSITIONS[self._state, Event.FAILED]
            self._reason = sentence
            withdrawn = self._jobs.fail(others_error)
            if job is not None:
                job.interrupt = job_error  # the driver may return
        what_next = job_error.advice if self._fatal_error else f"Once it is mended: {CLEAR}"
        self._announce(logging.ERROR, f"fault: {sentence} {what_next}")
        self._outbox.withdraw(withdrawn)
        if job is not None:
            self._outbox.finish(job, job.error(job_error))

    def _announce(self, level: int, sentence: str) -> None:
        sentence = with_address(sentence, self._address)
        self._log.log(level, "%s", sentence)
        self._manager.status(sentence)
