"""What a trial shows: a line for each joint and each sensor, the keys, and a message."""

from __future__ import annotations

import math
from typing import Final

from robot.configuration.joint_calibration import DrivenJoint
from robot.configuration.robot_config import RobotConfig
from robot.trial.joints import JointsOnTrial
from robot.trial.live_sensors import LiveSensors

KEYS: Final = (
    "up, down: another joint    left, right: 1°    PgUp, PgDn: 10°    0: to zero",
    "space: stop    r: look again    q: quit; the robot holds",
)


def head(
    config: RobotConfig, joints: JointsOnTrial, sensors: LiveSensors, message: str
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


def row(joint: DrivenJoint, joints: JointsOnTrial) -> str:
    """One joint: where it was sent, and how far it may go."""
    low, high = (math.degrees(angle) for angle in joint.reachable)
    angle = joints.angle(joint)
    where = "limp" if angle is None else f"{math.degrees(angle):+.1f}°"
    return (
        f"{'>' if joint is joints.chosen else ' '} {joint.name:<20} {where:>8}  {low:.0f}° to "
        f"{high:.0f}°; output {joint.output}, count {joints.counts[joint.output]}"
    )
