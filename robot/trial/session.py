"""A trial, turn by turn: keys come in, one joint moves, every sensor is shown."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Final, Protocol

from robot.configuration.joint_calibration import DrivenJoint
from robot.configuration.robot_config import RobotConfig
from robot.control.interaction import LATENESS
from robot.control.motion import Slew
from robot.drivers.buses import Buses
from robot.drivers.guard import open_driver
from robot.drivers.servos.servo_bus import ServoBus, answering
from robot.errors import CommandError, DeviceDataError, DeviceError
from robot.host.clock import Clock
from robot.trial.live_sensors import LiveSensors

TURN: Final = 0.01  # s
SHOWN_EVERY: Final = 0.2  # s
CHECKED_EVERY: Final = 1.0  # s

STEPS: Final = MappingProxyType({"right": 1.0, "left": -1.0, "page up": 10.0, "page down": -10.0})
"""Degrees that a key moves the chosen joint by."""

QUIT: Final = "quit"

KEYS: Final = (
    "up, down: another joint    left, right: 1°    PgUp, PgDn: 10°    0: to zero",
    "space: stop    r: look again    q: quit; the robot holds",
)

HAND_KEYS: Final = "g, and g again: lets the joint go, to be moved by hand    h: holds it there"

LEAD: Final = math.radians(20)
"""Largest lead of a joint's goal over the joint, rad: it stops soon after the key is let go."""


class JointsUnderTest:
    """Commands one joint at a time; nobody but this object may move the servos meanwhile.

    A limp joint does not move before ``stiffen``, which holds it where its servo reports it, or, if
    nothing reports where it hangs, drives it to 0°. Every method that reaches the servos raises
    ``DeviceError`` where their driver failed, or does not answer.

    Args:
        config: Configuration of the robot.
        servos: Driver of its servos.
        clock: The robot clock.

    Attributes:
        counts: Count to which each output was sent; 0 where it is limp.
        chosen: The joint that moves.
    """

    def __init__(self, config: RobotConfig, servos: ServoBus, clock: Clock):
        self._joints = config.joints
        self._speed = config.speed
        self._servos = servos
        self._clock = clock
        self._slew: Slew | None = None
        self._goal = 0.0  # rad, while it moves
        self._answering = answering(servos)
        self._positions: Mapping[int, float] = {}
        self.chosen = self._joints[0]
        self.counts: Mapping[int, int] = {}
        self.look()

    @property
    def moving(self) -> bool:
        """Whether the chosen joint is on its way."""
        return self._slew is not None

    @property
    def limp(self) -> bool:
        """Whether the chosen joint gets no pulses."""
        return self.counts[self.chosen.output] == 0

    @property
    def answer(self) -> bool:
        """Whether the servos report their positions."""
        return self._answering is not None

    def ask(self) -> None:
        """Asks the servos for their positions, if they report them."""
        if self._answering is not None:
            outputs = [joint.output for joint in self._joints]
            states = self._answering.read_states(outputs)
            self._positions = {output: state.position for output, state in states.items()}

    def measured(self, joint: DrivenJoint) -> float | None:
        """Angle of a joint when the servos were last asked, rad; ``None`` if it is not known."""
        position = self._positions.get(joint.output)
        return None if position is None else joint.scale.angle(position)

    def let_go(self) -> None:
        """Lets the chosen joint go limp."""
        self.stop()
        output = self.chosen.output
        self._servos.release([output])
        self.counts = {**self.counts, output: 0}

    def look(self) -> None:
        """Takes the joints as the board has them now; a motion ends."""
        self.stop()
        self.counts = self._servos.read_counts([joint.output for joint in self._joints])

    def reconnect(self) -> None:
        """Opens the link to the servos anew, and calls ``look``."""
        self.stop()
        self._servos.reopen()
        self._servos.forget()
        self.look()

    def choose(self, steps: int) -> None:
        """Chooses another joint; a motion ends.

        Args:
            steps: How many joints further down the list; up if negative.
        """
        self.stop()
        index = self._joints.index(self.chosen) + steps
        self.chosen = self._joints[min(max(index, 0), len(self._joints) - 1)]

    def angle(self, joint: DrivenJoint) -> float | None:
        """The angle that a joint was sent to, rad; ``None`` for a limp one."""
        count = self.counts[joint.output]
        return joint.scale.angle(count) if count else None

    def move_to(self, angle: float) -> None:
        """Sends the chosen joint to an angle, rad, or as near to it as it may go.

        Raises:
            DeviceDataError: The joint is not where it should be, and would leap; nothing was sent.
        """
        joint = self.chosen
        if not self.moving:
            self.check()
        self._goal = angle
        self._slew = Slew(
            [joint],
            start=self.counts,
            targets={joint.output: joint.quantise(angle)},
            speed=self._speed,
            period=LATENESS * self._servos.seconds_for(1),
            now=self._clock.now(),
        )

    def move_by(self, degrees: float) -> None:
        """Moves the goal of the chosen joint by so many degrees, up or down.

        However often this is called, its goal is never more than ``LEAD`` from where it is.
        """
        angle = self.angle(self.chosen) or 0.0
        goal = (self._goal if self.moving else angle) + math.radians(degrees)
        self.move_to(min(max(goal, angle - LEAD), angle + LEAD))

    def stiffen(self) -> None:
        """Holds the chosen, limp joint where its servo reports it, or at 0° if it does not.

        It goes to 0° at its servo's own speed.
        """
        self.ask()
        joint = self.chosen
        count = joint.scale.count(self.measured(joint) or 0.0)
        self._send({joint.output: joint.nearest(count)})

    def stop(self) -> None:
        """Ends a motion: the joint holds the count that it was last sent."""
        self._slew = None

    def advance(self) -> bool:
        """Sends what is due; at the end of a motion, checks that the board has it.

        Returns:
            Whether something was sent, which has taken time.

        Raises:
            DeviceError: The servo driver failed, or was reset; the motion has ended.
        """
        slew = self._slew
        if slew is None:
            return False
        if slew.arrived:
            self.stop()
            self.check()
            return False
        now = self._clock.now()
        counts = slew.due(now, at_most=1)
        if counts:
            self._send(counts)
            slew.sent(counts, now)
        return bool(counts)

    def check(self) -> None:
        """Checks that the board still has the chosen joint's count.

        Raises:
            DeviceDataError: The board has another count; a motion has ended.
        """
        joint = self.chosen
        try:
            lost = self._servos.verify({joint.output: self.counts[joint.output]})
        except BaseException:
            self.stop()
            raise
        if lost:
            self.stop()
            raise DeviceDataError(
                f"The servo board ({self._servos.name}) does not have the command for "
                f"{joint.name}: it was reset, another program wrote to "
                "it, or bytes were lost.",
                "Check the servos' supply, that nothing else drives them, then the cable.",
            )

    def _send(self, counts: Mapping[int, int]) -> None:
        self.counts = {**self.counts, **counts}
        try:
            self._servos.set_counts(counts)
        except BaseException:
            self.stop()
            raise


class View(Protocol):
    """The terminal of a trial."""

    def key(self) -> str | None:
        """The next key that was pressed, if any; ``QUIT`` when somebody wants to leave."""

    def show(self, text: Sequence[str], rows: Sequence[str], *, keep: int) -> None:
        """Shows lines, and below them the rows that there is room for, ``keep`` among them."""


class Trial:
    """Moves joints and reads sensors until somebody leaves; the robot then holds.

    Args:
        config: Configuration of the robot.
        buses: Buses that lead to its devices.
        view: The terminal.
        by_hand: Whether joints may be let go, one at a time.
    """

    def __init__(self, config: RobotConfig, buses: Buses, view: View, *, by_hand: bool = False):
        self._by_hand = by_hand
        self._config = config
        self._buses = buses
        self._clock: Clock = buses.clock
        self._view = view
        self._sensors = LiveSensors(config, buses)
        self._message = ""
        self._asked = False  # whether a limp joint may be driven
        self._failed = False  # whether the servos failed

    def run(self) -> None:
        """Runs the trial.

        Raises:
            CommandError: Joints shall be moved by hand, and no servo says where it is.
            DeviceError: The servo driver cannot be opened, or does not answer.
        """
        servos: ServoBus = open_driver(self._config.servos, self._buses)
        try:
            self._joints = JointsUnderTest(self._config, servos, self._clock)
            if self._by_hand and not self._joints.answer:
                raise CommandError(
                    f"these servos ({servos.name}) do not say where they are: leave out --limp"
                )
            self._sensors.open()
            self._take_turns()
        finally:
            self._sensors.close()
            servos.close()

    def _take_turns(self) -> None:
        shown_at = checked_at = self._clock.now()
        self._show()
        while (key := self._view.key()) != QUIT:
            if key is not None:
                self._attempt(partial(self._press, key))
            sent = self._attempt(self._joints.advance)
            now = self._clock.now()
            if now - checked_at >= CHECKED_EVERY and not (self._joints.moving or self._failed):
                self._attempt(self._joints.check)
                checked_at = now
            if key is not None or now - shown_at >= SHOWN_EVERY:
                if not (self._joints.moving or self._failed):
                    self._attempt(self._joints.ask)
                self._show()
                shown_at = now
            if not sent:
                self._clock.sleep(TURN)

    def _press(self, key: str) -> None:
        joints = self._joints
        asked, self._asked, self._message = self._asked, False, ""
        if key in ("up", "down") and self._by_hand and joints.limp:
            self._message = f"{joints.chosen.name} is limp: h holds it where it is."
        elif key in ("up", "down"):
            joints.choose(-1 if key == "up" else 1)
        elif key == "space":
            joints.stop()
            self._message = "Stopped: it holds."
        elif key == "r":
            self._look_again()
        elif self._failed:
            self._message = "The servos failed: r looks again."
        elif joints.limp and key in (*STEPS, "0", "h"):
            self._press_limp(key, asked=asked)
        elif key == "g" and self._by_hand and not joints.limp:
            if asked:
                joints.let_go()
            else:
                self._asked = True
                self._message = f"Support {joints.chosen.name}, then g again lets it go."
        elif key in STEPS:
            joints.move_by(STEPS[key])
        elif key == "0":
            joints.move_to(0.0)

    def _press_limp(self, key: str, *, asked: bool) -> None:
        """Handles a key that would move the chosen joint, which is limp."""
        joints = self._joints
        if key == "h" and (asked or joints.answer):
            joints.stiffen()
        elif joints.answer:
            self._message = f"{joints.chosen.name} is limp: h holds it where it is."
        else:
            self._asked = key == "h"
            self._message = (
                f"{joints.chosen.name} is limp: h, and h again, drives it to 0° at its servo's "
                "own speed. Hold it."
            )

    def _look_again(self) -> None:
        self._joints.reconnect()
        self._failed = False
        self._sensors.open()
        self._message = "Looked again."

    def _attempt(self, action: Callable[[], bool | None]) -> bool:
        """Does something with the servos; what fails is said, and nothing moves until ``r``."""
        try:
            return bool(action())
        except DeviceError as error:
            self._joints.stop()
            self._failed = True
            self._message = f"! {error} Then: r"
            return False

    def _show(self) -> None:
        self._sensors.sample()
        joints = self._config.joints
        self._view.show(
            head(self._config, self._joints, self._sensors, self._message, by_hand=self._by_hand),
            [row(joint, self._joints) for joint in joints],
            keep=joints.index(self._joints.chosen),
        )


def head(
    config: RobotConfig,
    joints: JointsUnderTest,
    sensors: LiveSensors,
    message: str,
    *,
    by_hand: bool = False,
) -> list[str]:
    """Lines that show the sensors, a message, and the keys."""
    width = max((len(row.name) for row in sensors.rows), default=0)
    return [
        *(f"{'!' if one.failed else ' '} {one.name:<{width}}  {one.text}" for one in sensors.rows),
        "",
        message or f"{config.name}: {'moving' if joints.moving else 'holding'}",
        *KEYS,
        *([HAND_KEYS] if by_hand else []),
        "",
    ]


def row(joint: DrivenJoint, joints: JointsUnderTest) -> str:
    """Line that shows a joint: where it was sent, where it is, and how far it may go."""
    low, high = (math.degrees(angle) for angle in joint.reachable)
    angle = joints.angle(joint)
    sent = "limp" if angle is None else f"{math.degrees(angle):+.1f}°"
    measured = joints.measured(joint)
    position = "" if measured is None else f" is {math.degrees(measured):+.1f}°"
    marker = ">" if joint is joints.chosen else " "
    return (
        f"{marker} {joint.name:<20} {sent:>8}{position}  {low:.0f}° to {high:.0f}°; output "
        f"{joint.output}, count {joints.counts[joint.output]}"
    )
