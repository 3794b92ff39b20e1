"""The choreography of one interaction, on the devices of one robot.

Return to zero, settle, see that the robot lies flat; slew every joint to its own target, settle,
average, read. ``report(phase, fraction)`` is called before each serial line, query and sample, and
may raise ``RobotError`` there: the servos then stay at the last commanded counts.

The servo board acknowledges nothing, and other programs may reach it, so it is asked before a
motion, and before and after a reading, whether it still has the counts that it was sent: what an
observation calls commanded was so all along. A board that was reset in mid-motion ignores the rest
of the motion, and is found out when that has ended, if not before.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final, NamedTuple, Protocol

from protocol.errors import RobotError
from protocol.rules.transitions import Event
from protocol.wire.messages import State
from robot.configuration.joint_calibration import DrivenJoint
from robot.configuration.robot_config import RobotConfig
from robot.control.joint_watch import LIMITED, JointWatch, cut_short
from robot.control.motion import Slew
from robot.drivers.servos.servo_bus import ServoBus, answering
from robot.errors import DeviceDataError
from robot.host.clock import MAX_GAP, SteadyClock
from robot.sensing.samples import RestDetector
from robot.sensing.sensors import OnProgress, Reading, RobotSensors

LATENESS: Final = 1.25  # times the line's own period: an update may be that late and lose no way
FLAT_TILT: Final = math.radians(3)
"""Most that the tilt in the zero pose may differ from its reference, rad: ten times the usual
noise of tilt."""

FLAT_CLEARANCE: Final = 0.005
"""Most that the clearance in the zero pose may differ from its reference, m: five times the usual
noise."""

_SAMPLE_TIME: Final = 0.25  # s for one sample of all sensors, at the very most

Report = Callable[[str, float], None]


class _Rest(NamedTuple):
    """Whether the robot came to rest, how long that took (s), and its tilt at rest (rad)."""

    settled: bool
    seconds: float
    tilt: tuple[float, ...] | None


class Operator(Protocol):
    """A person beside the robot, or what takes their place.

    Attributes:
        lays_down: Whether the operator lays the robot on its belly at each interaction; whether it
            lies flat is then not checked.
    """

    lays_down: bool

    def attend(self) -> None:
        """Called at each interaction, once the joints are at zero."""


class MotorProgramRunner:
    """Performs motor programs.

    Methods raise ``DeviceError`` where a device failed, and ``RobotError`` where ``report`` or
    ``check``, which each is given, raised it: they are called before each sample, line and query.

    Args:
        config: Configuration of the robot.
        servos: The servo driver.
        sensing: The sensors.
        clock: The robot clock.
        revive: Makes the devices work again after a fault, or raises ``DeviceError``.
        operator: The operator, or ``None``. Unless the operator lays the robot down, its zero pose
            is compared with the first one since a client took control, which must be flat unless
            the robot stands in it; a zero pose that differs is refused with ``not_planar``.
    """

    def __init__(
        self,
        config: RobotConfig,
        *,
        servos: ServoBus,
        sensing: RobotSensors,
        clock: SteadyClock,
        revive: Callable[[], None],
        operator: Operator | None,
    ):
        self._config = config
        self._joints = config.joints
        self._rest = config.settling
        self._servos = servos
        self._answering = answering(servos)
        self._watch = JointWatch(self._joints)
        self._sensing = sensing
        self._clock = clock
        self._revive = revive
        self._operator = operator
        self._outputs = [joint.output for joint in self._joints]
        # Where the board stands now: the motion slews from there and never jumps.
        self._counts = self._board_counts()
        self._refuse_limited()
        self._released = False
        self._flat: Reading | None = None

    @property
    def limp(self) -> bool:
        """Whether the board sends no pulses to some joint."""
        return any(self._counts[output] == 0 for output in self._outputs)

    @property
    def measures(self) -> bool:
        """Whether the servos report their positions."""
        return self._answering is not None

    def now(self) -> float:
        """Robot time, s."""
        return self._clock.now()

    def angles(self) -> dict[str, float]:
        """The angle that each joint is commanded to, rad; none for a joint that is limp."""
        return {joint.name: joint.scale.angle(count) for joint, count in self._commanded()}

    def perform(self, targets: Mapping[str, float], report: Report) -> Reading:
        """Performs one interaction.

        Raises:
            RobotError: ``not_settled``, ``not_planar``: in its zero pose the robot does not come to
                rest, or not as it should.
        """
        self.check_board(partial(report, "homing", 0.0))
        self._clock.watch()
        self._slew(dict.fromkeys(targets, 0.0), "homing", report)
        if self._operator is not None:
            self._operator.attend()
        zero = self._settle(report)
        if self._operator is None or not self._operator.lays_down:
            flat = self._average(lambda _: report("settling", 1.0))
            self._check_flat(flat, settled=zero.settled)
        if self._answering is not None:
            self._watch.begin(self._answering.read_states(self._outputs))
        self._slew(targets, "moving", report)
        return replace(self._observe(report), zero_tilt=zero.tilt)

    def read(self, report: Report) -> Reading:
        """Waits for rest in the present pose, and averages the sensors."""
        self._clock.watch()
        return self._observe(report)

    def command(self, event: Event, state: State, check: Callable[[], None]) -> None:
        """Carries out what a hold, relax or clear asks of the servos; a stop asks nothing of them.

        Args:
            event: Hold, relax, clear or stop.
            state: The robot's state. A clear after a stop holds all joints, also those that were
                limp before it, as ``_stiffen`` does; a clear after a fault makes the devices work
                and tries all of them.
            check: Where it raises ``RobotError``, nothing is sent.
        """
        if event is Event.RELAX:
            self._servos.release(self._outputs)  # joints count as driven where it fails
            self._released = True
        elif event is Event.CLEAR and state is State.FAULT:
            self._recover(check)
        elif event is Event.HOLD or (event is Event.CLEAR and state is State.STOPPED):
            self.check_board(check)  # after a reset the servos would leap back from neutral
            self._stiffen()

    def check_board(self, check: Callable[[], None], outputs: Sequence[int] | None = None) -> None:
        """Compares the board's counts, of all outputs or of some, with those that it was sent.

        Raises:
            DeviceDataError: They differ: the board was reset, or bytes were lost.
        """
        checked = self._outputs if outputs is None else outputs
        group_size = self._config.servos.per_update  # queries to a slow board take a while
        lost = []
        for start in range(0, len(checked), group_size):
            check()
            group = checked[start : start + group_size]
            lost += self._servos.verify(
                {output: 0 if self._released else self._counts[output] for output in group}
            )
        if lost:
            names = [joint.name for joint in self._joints if joint.output in lost]
            raise DeviceDataError(
                f"The servo board ({self._servos.name}) does not have the commands for "
                f"{', '.join(names)}: it was reset, another program wrote to "
                "it, or bytes were lost.",
                "Check the servos' supply, that nothing else drives them, then the cable.",
            )

    def park(self, report: Report) -> None:
        """Slews to zero."""
        self.check_board(partial(report, "homing", 0.0))
        self._clock.watch()
        zero = {joint.name: 0.0 for joint in self._joints}
        self._slew(zero, "homing", report)

    def forget_flat(self) -> None:
        """Takes the next zero pose as the reference for lying flat."""
        self._flat = None

    def _observe(self, report: Report) -> Reading:
        """Waits for rest, averages, and makes sure that the board had its commands all along."""
        rest = self._settle(report)
        self.check_board(partial(report, "settling", 1.0))
        reading = self._measured(self._average(partial(report, "sampling")))
        self.check_board(partial(report, "sampling", 1.0))
        ends = tuple(joint.name for joint, count in self._commanded() if joint.at_end(count))
        return replace(
            reading,
            saturated_joints=ends,
            settled=rest.settled,
            settle_time=rest.seconds,
        )

    def _measured(self, reading: Reading) -> Reading:
        """A reading with the measured angles of the joints, if their servos report them."""
        if self._answering is None:
            return reading
        states = self._answering.read_states(self._outputs)
        return replace(
            reading,
            measured=self._watch.angles(states),
            off_target=self._watch.off_target(self.angles(), states) or None,
        )

    def _commanded(self) -> list[tuple[DrivenJoint, int]]:
        """The joints that are not limp, and their counts."""
        if self._released:
            return []
        counts = self._counts
        commanded = [(joint, counts[joint.output]) for joint in self._joints]
        return [(joint, count) for joint, count in commanded if count]

    def _recover(self, check: Callable[[], None]) -> None:
        """Makes the devices work, tries all of them, and goes on from where the joints stand.

        A board that was reset keeps the counts that it has now; joints that are limp are held.
        """
        self._servos.forget()
        self._revive()
        board = self._board_counts()
        self._counts = {output: board[output] or self._counts[output] for output in board}
        self._released = False
        if not all(board.values()):
            self._stiffen()
        self._clock.watch()  # to set devices up may take a while
        self._average(lambda _: check())
        self.check_board(check)

    def _stiffen(self) -> None:
        """Holds each joint; a limp one is held where it is, if its servo reports that.

        Otherwise a limp joint is sent its last commanded count, to which it returns at its servo's
        own speed; one that was limp when the daemon started returns to zero.
        """
        if self._answering is not None:
            states = self._answering.read_states(self._outputs)
            self._counts = self._counts | {
                joint.output: joint.nearest(states[joint.output].position)
                for joint in self._joints
                if not states[joint.output].driven
            }
        self._counts = {
            joint.output: self._counts[joint.output] or joint.scale.count(0.0)
            for joint in self._joints
        }
        self._released = False  # if sending fails half-way, some joints are driven
        self._servos.set_counts(self._counts)

    def _slew(self, targets: Mapping[str, float], phase: str, report: Report) -> None:
        slew = Slew(
            sorted(self._joints, key=lambda joint: joint.output),  # board by board
            start=self._counts,
            targets={j.output: j.quantise(targets[j.name]) for j in self._joints},
            speed=self._config.speed,
            period=LATENESS * self._servos.seconds_for(len(self._joints)),
            now=self._clock.now(),
        )
        while not slew.arrived:
            report(phase, slew.fraction)
            self._clock.check()
            now = self._clock.now()
            counts = slew.due(now, at_most=self._config.servos.per_update)
            if not counts:
                self._clock.sleep(0.005)
                continue
            self._counts = self._counts | counts
            self._servos.set_counts(counts)
            slew.sent(counts, now)
        # A board that was reset meanwhile answers to no query.
        self.check_board(partial(report, phase, 1.0), self._outputs[:1])

    def _settle(self, report: Report) -> _Rest:
        detector = RestDetector(self._rest)
        start = self._clock.now()
        while True:
            self._clock.check()
            now = self._clock.now()
            report("settling", min(1.0, (now - start) / self._rest.timeout))
            tilt = self._sensing.tilt()
            if tilt is not None and detector.feed(now, tilt):
                return _Rest(True, now - start, detector.mean())
            if now - start >= self._rest.timeout:
                return _Rest(False, now - start, None)
            self._clock.sleep(1.0 / self._rest.rate)

    def _check_flat(self, reading: Reading, *, settled: bool) -> None:
        if not settled and reading.tilt is not None:  # without an accelerometer nobody can tell
            raise RobotError(
                "not_settled",
                f"In its zero pose the robot did not come to rest within {self._rest.timeout:g} s.",
            )
        level = Reading(tilt=(0.0, 0.0), clearance=0.0)
        reference = self._flat or (level if self._config.body.lies_flat else reading)
        tilts = zip(reading.tilt or (0.0, 0.0), reference.tilt or (0.0, 0.0), strict=True)
        lean = max(abs(a - b) for a, b in tilts)
        lift = abs((reading.clearance or 0.0) - (reference.clearance or 0.0))
        if lean > FLAT_TILT or lift > FLAT_CLEARANCE:
            where = "" if self._config.body.lies_flat else " where it stood at first"
            raise RobotError(
                "not_planar",
                f"In its zero pose the robot leans by {math.degrees(lean):.1f}° "
                f"and stands {lift * 1000:.0f} mm off{where}.",
            )
        self._flat = reference if self._flat else reading

    def _average(self, report: OnProgress) -> Reading:
        self._clock.check()
        samples = self._config.samples
        reading = self._sensing.average(samples, report)
        self._clock.check(MAX_GAP + samples * (1.0 / self._rest.rate + _SAMPLE_TIME))
        return reading

    def _board_counts(self) -> dict[int, int]:
        """The board's counts, read twice: a motion that began from wrong ones would leap."""
        counts = self._servos.read_counts(self._outputs)
        if self._servos.verify(counts):
            raise DeviceDataError(
                f"Two readings of the servo counts ({self._servos.name}) differ.",
                "Check the cable, the ground and the baud rate.",
            )
        return counts

    def _refuse_limited(self) -> None:
        """Refuses servos that would drive less far than they are told, and say nothing."""
        if self._answering is not None:
            states = self._answering.read_states(self._outputs)
            for joint in self._joints:
                if limitation := cut_short(joint, states[joint.output]):
                    raise DeviceDataError(f"{limitation[0].upper()}{limitation[1:]}.", LIMITED)
