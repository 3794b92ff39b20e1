"""What one interaction returned, in the shape in which runs keep it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from estimator.body.morphology import Array
from protocol.wire import messages
from protocol.wire.capabilities import Capabilities

Reading = Annotated[float, Field(allow_inf_nan=False)]
Program = tuple[Reading, ...]
"""A motor program: one target angle per joint, rad, in motor order."""


@dataclass(frozen=True, kw_only=True)
class ObservedReadings:
    """What the robot felt in one interaction, as arrays; NaN where a reading is missing.

    Attributes:
        angles: The angle of each motor that the robot really took, rad, shape (motors,).
        touch: 0 or 1 per touch sensor, shape (s,).
        tilt: Left/right and forward/back, rad, shape (2,).
        clearance: m.
    """

    angles: Array
    touch: Array
    tilt: Array
    clearance: float


class Observation(BaseModel):
    """One interaction's readings; ``None`` stands for a reading that was not taken.

    Attributes:
        angles: Angles actually commanded, rad, one per joint in motor order.
        touch: One value per touch sensor.
        tilt: Left/right and forward/back, rad; left side up and nose up are positive.
        clearance: Belly to ground along the belly's normal, m.
        clearance_saturated: The ground lay beyond the sensor's range.
        settled: Whether the robot came to rest before it was read.
        saturated_joints: Names of joints that stood at the end of what they can reach.
        sequence: The robot's number of this observation, where a daemon counted.
        robot_time: Robot clock at the end of sampling, s, where a daemon took it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    angles: Program
    touch: tuple[bool | None, ...] = ()
    tilt: tuple[Reading | None, Reading | None] = (None, None)
    clearance: Reading | None = None
    clearance_saturated: bool = False
    settled: bool = True
    saturated_joints: tuple[str, ...] = ()
    sequence: int | None = None
    robot_time: Reading | None = None

    @classmethod
    def from_wire(cls, reply: messages.ObservationReply, capabilities: Capabilities) -> Observation:
        """The same observation, with joints in motor order instead of by name."""
        sensor = capabilities.sensor("touch")
        absent: tuple[bool | None, ...] = (None,) * (sensor.count if sensor else 0)
        tilt = (None, None) if reply.tilt is None else (reply.tilt[0], reply.tilt[1])
        return cls(
            angles=in_motor_order(reply.angles, capabilities),
            touch=absent if reply.touch is None else reply.touch,
            tilt=tilt,
            clearance=reply.clearance,
            clearance_saturated=reply.clearance_saturated,
            settled=reply.settled,
            saturated_joints=reply.saturated_joints,
            sequence=reply.sequence,
            robot_time=reply.robot_time,
        )

    def as_arrays(self) -> ObservedReadings:
        """The angles and readings as arrays; NaN where a reading is missing."""
        missing = float("nan")
        return ObservedReadings(
            angles=np.array(self.angles, dtype=float),
            touch=np.array([missing if bit is None else bit for bit in self.touch], dtype=float),
            tilt=np.array([missing if angle is None else angle for angle in self.tilt]),
            clearance=missing if self.clearance is None else self.clearance,
        )


def in_motor_order(angles: Mapping[str, float], capabilities: Capabilities) -> Program:
    """Angles by joint name, as a program."""
    return tuple(angles[joint.name] for joint in capabilities.joints)


def by_joint_name(program: Program, capabilities: Capabilities) -> dict[str, float]:
    """A program, as the targets that go over the wire."""
    joints = capabilities.joints
    return {joint.name: angle for joint, angle in zip(joints, program, strict=True)}


def touched(sensors: Collection[int], observations: Sequence[Observation]) -> bool | None:
    """Whether a touch sensor among these felt the ground in some interaction.

    Args:
        sensors: Indices of touch sensors.
        observations: The interactions.

    Returns:
        ``None`` where none of them was read.
    """
    bits = [
        observation.touch[sensor]
        for observation in observations
        for sensor in sensors
        if sensor < len(observation.touch)
    ]
    known = [bit for bit in bits if bit is not None]
    return any(known) if known else None
