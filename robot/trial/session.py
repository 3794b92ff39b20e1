"""A trial, turn by turn: keys come in, one joint moves, every sensor is shown."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from types import MappingProxyType
from typing import Final, Protocol

from robot.configuration.joint_calibration import DrivenJoint
from robot.configuration.robot_config import RobotConfig
from robot.drivers.buses import Buses
from robot.drivers.guard import open_driver
from robot.drivers.servos.servo_bus import ServoBus
from robot.errors import DeviceError
from robot.host.clock import Clock
from robot.trial.joints import JointsUnderTest
from robot.trial.live_sensors import LiveSensors

TURN: Final = 0.01  # s
SHOWN_EVERY: Final = 0.2  # s
CHECKED_EVERY: Final = 1.0  # s

STEPS: Final = MappingProxyType({"right": 1.0, "left": -1.0, "page up": 10.0, "page down": -10.0})
"""Degrees that a key moves the chosen joint by."""

QUIT: Final = "quit"


class View(Protocol):
    """The terminal of a trial."""

    def key(self) -> str | None:
        """The next key that was pressed, if any; ``QUIT`` when somebody wants to leave."""

    def show(self, text: Sequence[str], rows: Sequence[str], *, keep: int) -> None:
        """Shows lines, and below them the rows that there is room for, ``keep`` among them."""


class Trial:
    """Moves joints and reads sensors until somebody leaves; the robot then holds.

    Args:
        config: The robot.
        buses: What leads to its devices.
        view: The terminal.
    """

    def __init__(self, config: RobotConfig, buses: Buses, view: View):
        self._config = config
        self._buses = buses
        self._clock: Clock = buses.clock
        self._view = view
        self._sensors = LiveSensors(config, buses)
        self._message = ""
        self._asked = False  # whether a limp joint may be driven
        self._down = False  # whether the servos failed

    def run(self) -> None:
        """Runs the trial.

        Raises:
            DeviceError: The servo driver cannot be opened, or does not answer.
        """
        servos: ServoBus = open_driver(self._config.servos, self._buses)
        try:
            self._joints = JointsUnderTest(self._config, servos, self._clock)
            self._sensors.open()
            self._take_turns()
        finally:
            self._sensors.close()
            servos.close()

    def _take_turns(self) -> None:
        shown = checked = self._clock.now()
        self._show()
        while (key := self._view.key()) != QUIT:
            if key is not None:
                self._attempt(partial(self._press, key))
            sent = self._attempt(self._joints.advance)
            now = self._clock.now()
            if now - checked >= CHECKED_EVERY and not (self._joints.moving or self._down):
                self._attempt(self._joints.check)
                checked = now
            if key is not None or now - shown >= SHOWN_EVERY:
                self._show()
                shown = now
            if not sent:
                self._clock.sleep(TURN)

    def _press(self, key: str) -> None:
        joints = self._joints
        asked, self._asked, self._message = self._asked, False, ""
        if key in ("up", "down"):
            joints.choose(-1 if key == "up" else 1)
        elif key == "space":
            joints.stop()
            self._message = "Stopped: it holds."
        elif key == "r":
            self._look_again()
        elif self._down:
            self._message = "The servos failed: r looks again."
        elif joints.limp and key in (*STEPS, "0", "h"):
            if key == "h" and asked:
                joints.stiffen()
            else:
                self._asked = key == "h"
                self._message = (
                    f"{joints.chosen.name} is limp: h, and h again, drives it to 0° at its servo's "
                    "own speed. Hold it."
                )
        elif key in STEPS:
            joints.move_by(STEPS[key])
        elif key == "0":
            joints.move_to(0.0)

    def _look_again(self) -> None:
        self._joints.reconnect()
        self._down = False
        self._sensors.open()
        self._message = "Looked again."

    def _attempt(self, action: Callable[[], bool | None]) -> bool:
        """Does something with the servos; what fails is said, and nothing moves until ``r``."""
        try:
            return bool(action())
        except DeviceError as error:
            self._joints.stop()
            self._down = True
            self._message = f"! {error} Then: r"
            return False

    def _show(self) -> None:
        self._sensors.sample()
        joints = self._config.joints
        self._view.show(
            head(self._config, self._joints, self._sensors, self._message),
            [row(joint, self._joints) for joint in joints],
            keep=joints.index(self._joints.chosen),
        )


KEYS: Final = (
    "up, down: another joint    left, right: 1°    PgUp, PgDn: 10°    0: to zero",
    "space: stop    r: look again    q: quit; the robot holds",
)


def head(
    config: RobotConfig, joints: JointsUnderTest, sensors: LiveSensors, message: str
) -> list[str]:
    """The sensors, a message, and the keys."""
    width = max(len(row.name) for row in sensors.rows)
    return [
        *(f"{'!' if one.failed else ' '} {one.name:<{width}}  {one.text}" for one in sensors.rows),
        "",
        message or f"{config.name}: {'moving' if joints.moving else 'holding'}",
        *KEYS,
        "",
    ]


def row(joint: DrivenJoint, joints: JointsUnderTest) -> str:
    """One joint: where it was sent, and how far it may go."""
    low, high = (math.degrees(angle) for angle in joint.reachable)
    angle = joints.angle(joint)
    where = "limp" if angle is None else f"{math.degrees(angle):+.1f}°"
    return (
        f"{'>' if joint is joints.chosen else ' '} {joint.name:<20} {where:>8}  {low:.0f}° to "
        f"{high:.0f}°; output {joint.output}, count {joints.counts[joint.output]}"
    )
