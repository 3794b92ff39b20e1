"""Joints whose servos report their positions: which are not where they were sent, and why.

A servo that pushes and takes no current has a dead motor; a joint that does not turn at all is
jammed. One that stops on its way is blocked, or too weak for the load on it: after one movement
nobody can tell which, nor of a joint that was not seen to move. A block is always at the same
angle, one for each direction; where a joint sags depends on the load. What a movement has shown of
a joint stands until the next one, or until the joint is where it was sent.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Final

from robot.configuration.joint_calibration import DrivenJoint
from robot.drivers.servos.servo_bus import ServoState

OFF: Final = math.radians(3)
"""Angle from its command, rad, beyond which a joint at rest is off target; backlash and a
regulator's droop are less."""

DEAD: Final = "dead"
JAMMED: Final = "jammed"
STOPPED: Final = "blocked or too weak"
BLOCKED: Final = "blocked"
SAGGING: Final = "sagging"

_PUSHES: Final = 0.2  # share of a servo's drive; a sound motor that pushes so takes more than:
_NO_CURRENT: Final = 0.05  # A
_STILL: Final = math.radians(1)
_SAME_STOP: Final = math.radians(1.5)  # a stop is always at the same angle, within that


class JointWatch:
    """Remembers where joints came to a stop.

    Args:
        joints: The driven joints.
    """

    def __init__(self, joints: Sequence[DrivenJoint]):
        self._joints = joints
        self._start: dict[str, float] = {}
        self._known: dict[str, str] = {}  # kinds found since then
        self._stops: dict[tuple[str, float], list[float]] = defaultdict(list)  # by joint, direction

    def angles(self, states: Mapping[int, ServoState]) -> dict[str, float]:
        """Angles of the joints by name, rad."""
        return {
            joint.name: joint.scale.angle(states[joint.output].position) for joint in self._joints
        }

    def begin(self, states: Mapping[int, ServoState]) -> None:
        """Notes where a movement begins."""
        self._start = self.angles(states)
        self._known.clear()

    def off_target(
        self, commanded: Mapping[str, float], states: Mapping[int, ServoState]
    ) -> dict[str, str]:
        """The joints at rest that are not where they were sent, by name, each with its kind.

        Args:
            commanded: Commanded angles by joint, rad; none for a limp one.
            states: States of the servos by output.
        """
        kinds = {}
        angles = self.angles(states)
        for joint in self._joints:
            target = commanded.get(joint.name)
            if target is not None:
                kind = self._kind(joint, target, angles[joint.name], states[joint.output])
                if kind:
                    kinds[joint.name] = kind
        return kinds

    def _kind(self, joint: DrivenJoint, target: float, here: float, state: ServoState) -> str:
        if abs(target - here) <= OFF:
            self._known.pop(joint.name, None)
            self._reached(joint, here)
            return ""
        is_pushing = state.load is not None and abs(state.load) >= _PUSHES
        if is_pushing and state.current is not None and state.current < _NO_CURRENT:
            return DEAD
        if joint.name not in self._start:
            return STOPPED
        if joint.name not in self._known:
            self._known[joint.name] = self._found(joint, target, here)
        return self._known[joint.name]

    def _reached(self, joint: DrivenJoint, here: float) -> None:
        """Notes that a joint may have gone beyond where it had stopped: that was no block."""
        for side in (-1.0, 1.0):
            stops = self._stops[joint.name, side]
            if any((here - stop) * side > _SAME_STOP for stop in stops):
                stops[:] = [side * math.inf]

    def _found(self, joint: DrivenJoint, target: float, here: float) -> str:
        """What a movement that has ended off its target has shown."""
        side = math.copysign(1.0, target - here)
        start = self._start[joint.name]
        if abs(here - start) < _STILL and (target - start) * side > OFF:
            return JAMMED
        stops = self._stops[joint.name, side]
        elsewhere = [stop for stop in stops if not math.isclose(stop, here, abs_tol=_SAME_STOP)]
        stopped_before = len(elsewhere) < len(stops)
        stops.append(here)
        if elsewhere:
            return SAGGING
        return BLOCKED if stopped_before else STOPPED


def cut_short(joint: DrivenJoint, state: ServoState) -> str:
    """Says that a servo's own limits are narrower than its joint's; empty if they are not.

    Such a servo drives to its limit, and reports nothing.
    """
    if state.limits is None:
        return ""
    counts = sorted(joint.scale.count(angle) for angle in joint.reachable)
    if state.limits[0] <= counts[0] and counts[1] <= state.limits[1]:
        return ""
    return (
        f"the servo {joint.output} of {joint.name} is limited to counts {state.limits[0]:g} to "
        f"{state.limits[1]:g} in its own memory, and the joint goes from {counts[0]} to {counts[1]}"
    )


LIMITED: Final = "Narrow limits_deg of the joint, or widen those limits with the maker's program."


def told(
    off: Mapping[str, str], measured: Mapping[str, float], commanded: Mapping[str, float]
) -> str:
    """A sentence for people about the joints that are off target; empty if there are none."""
    names = [
        f"{name} is {kind}: at {math.degrees(measured[name]):.1f}° instead of "
        f"{math.degrees(commanded[name]):.1f}°"
        for name, kind in off.items()
    ]
    return f"{'; '.join(names)}." if names else ""
