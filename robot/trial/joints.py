"""The joints of a trial: one of them moves, never beyond its limits or faster than it may."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from robot.configuration.joint_calibration import DrivenJoint
from robot.configuration.robot_config import RobotConfig
from robot.control.interaction import LATENESS
from robot.control.motion import Slew
from robot.drivers.servos.servo_bus import ServoBus
from robot.errors import DeviceDataError
from robot.host.clock import Clock

LEAD: Final = math.radians(20)
"""How far ahead of a joint its goal may lie, rad: it stops soon after the key is let go."""


class JointsUnderTest:
    """Commands one joint at a time; nobody but this object may move the servos meanwhile.

    A joint that is limp does not move before ``stiffen``, because nothing tells where it hangs.

    Args:
        config: The robot.
        servos: Its servo driver.
        clock: The robot clock.

    Attributes:
        counts: Where each output was sent; 0 where it is limp.
        chosen: The joint that moves.

    Raises:
        DeviceError: The servo driver does not answer.
    """

    def __init__(self, config: RobotConfig, servos: ServoBus, clock: Clock):
        self._joints = config.joints
        self._speed = config.speed
        self._servos = servos
        self._clock = clock
        self._slew: Slew | None = None
        self._goal = 0.0  # rad, while it moves
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

    def look(self) -> None:
        """Takes the joints as the board has them now; a motion ends.

        Raises:
            DeviceError: The servo driver does not answer.
        """
        self.stop()
        self.counts = self._servos.read_counts([joint.output for joint in self._joints])

    def reconnect(self) -> None:
        """Opens the link to the servos anew, and looks.

        Raises:
            DeviceError: It cannot be opened, or nothing answers there.
        """
        self.stop()
        self._servos.reopen()
        self._servos.forget()
        self.look()

    def choose(self, steps: int) -> None:
        """Chooses another joint; a motion ends.

        Args:
            steps: How many further down the list, or up.
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
            DeviceError: It does not stand where it is thought to, and would leap; nothing was sent.
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
        """Sends the chosen joint so much further than it was sent, up or down.

        However often this is called, its goal is never more than ``LEAD`` from where it is.

        Raises:
            DeviceError: As ``move_to``.
        """
        here = self.angle(self.chosen) or 0.0
        goal = (self._goal if self.moving else here) + math.radians(degrees)
        self.move_to(min(max(goal, here - LEAD), here + LEAD))

    def stiffen(self) -> None:
        """Drives the chosen joint, which is limp, to 0°, at its servo's own speed.

        Raises:
            DeviceError: The servo driver failed.
        """
        joint = self.chosen
        self._send({joint.output: joint.scale.count(0.0)})

    def stop(self) -> None:
        """Ends a motion: the joint holds the count that it was last sent."""
        self._slew = None

    def advance(self) -> bool:
        """Sends what is due; at the end of a motion, asks whether the board has it.

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
        """Whether the board still has the chosen joint's count.

        Raises:
            DeviceDataError: It does not; a motion has ended.
            DeviceError: The servo driver failed.
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
