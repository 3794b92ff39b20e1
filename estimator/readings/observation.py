"""What one interaction returned, as runs keep it, and what bodies are predicted to return."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import zip_longest
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from estimator.body.arrays import Flags, Integers
from estimator.body.morphology import Array
from protocol.wire import messages
from protocol.wire.capabilities import Capabilities

Reading = Annotated[float, Field(allow_inf_nan=False)]
Program = tuple[Reading, ...]
"""A motor program: one target angle per joint, rad, in motor order."""
_SAME_ANGLE: Final = math.radians(0.1)


class Observation(BaseModel):
    """One interaction's readings; ``None`` stands for a reading that was not taken.

    Attributes:
        angles: Angles actually commanded, rad, one per joint in motor order.
        touch: One value per touch sensor.
        tilt: Left/right and forward/back, rad; left side up and nose up are positive.
        zero_tilt: The same in the zero pose before the robot moved; ``None`` where nobody told.
        clearance: Belly to ground along the belly's normal, m.
        clearance_saturated: Whether the ground lay beyond the sensor's range.
        settled: Whether the robot came to rest before it was read.
        saturated_joints: Names of joints that stood at the end of what they can reach.
        measured: Where each joint was, rad; empty where no servo measures it.
        off_target: Joints away from the angle commanded, by name, each with what may be wrong.
        sequence: The robot's number of this observation, where a daemon counted.
        robot_time: Robot clock at the end of sampling, s, where a daemon took it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    angles: Program
    touch: tuple[bool | None, ...] = ()
    tilt: tuple[Reading | None, Reading | None] = (None, None)
    zero_tilt: tuple[Reading, Reading] | None = None
    clearance: Reading | None = None
    clearance_saturated: bool = False
    settled: bool = True
    saturated_joints: tuple[str, ...] = ()
    measured: tuple[Reading | None, ...] = ()
    off_target: dict[str, str] = {}
    sequence: int | None = None
    robot_time: Reading | None = None

    @property
    def taken(self) -> Program:
        """The angles that the joints took: as measured, where they are; else as commanded, rad."""
        return tuple(
            angle if measured is None else measured
            for angle, measured in zip_longest(self.angles, self.measured)
        )

    @classmethod
    def from_wire(cls, reply: messages.ObservationReply, capabilities: Capabilities) -> Observation:
        """The observation that a reply holds, with joints in motor order instead of by name."""
        sensor = capabilities.sensor("touch")
        absent: tuple[bool | None, ...] = (None,) * (sensor.count if sensor else 0)
        tilt = (None, None) if reply.tilt is None else (reply.tilt[0], reply.tilt[1])
        return cls(
            angles=in_motor_order(reply.angles, capabilities),
            touch=absent if reply.touch is None else reply.touch,
            tilt=tilt,
            zero_tilt=None if reply.zero_tilt is None else (reply.zero_tilt[0], reply.zero_tilt[1]),
            clearance=reply.clearance,
            clearance_saturated=reply.clearance_saturated,
            settled=reply.settled,
            saturated_joints=reply.saturated_joints,
            measured=()
            if reply.measured is None
            else tuple(reply.measured.get(joint.name) for joint in capabilities.joints),
            off_target=dict(reply.off_target or {}),
            sequence=reply.sequence,
            robot_time=reply.robot_time,
        )


@dataclass(frozen=True, kw_only=True)
class PredictedReadings:
    """Predicted readings of n bodies at rest, as arrays.

    Attributes:
        touch: Shape (n, s): whether each touch sensor's part, or one rigidly joined to it, meets
            the ground.
        touch_doubtful: Shape (n, s): whether the gap is so small that a real gauge might say
            otherwise.
        tilt: Shape (n, 2): left/right and forward/back, rad.
        clearance: Shape (n,), m.
        saturated: Shape (n,): whether the ground lies beyond the sensor's range.
        speed: Shape (n,): speed of the main body at the last step, m/s.
        joint_miss: Shape (n,): largest distance of a joint from its target, rad.
        valid: Shape (n,): whether the simulation can be believed. False where a joint missed its
            target, the simulation diverged, or the engine refused the body; such a body loses
            against any other, and the search counts it.
        undecided: Shape (n,): whether the body is balanced on the rim of its support and might as
            well lie elsewhere, so that the reading says nothing. Only a back-end that computes the
            pose can know; one that simulates never says so.
        stance: Shape (n,): what the body rests on, as the back-end numbers it; −1: not known. For
            ``ArrayPhysics.read_bodies`` of bodies that are nearly the same.
    """

    touch: Flags
    touch_doubtful: Flags
    tilt: Array
    clearance: Array
    saturated: Flags
    speed: Array
    joint_miss: Array
    valid: Flags
    undecided: Flags
    stance: Integers

    def __len__(self) -> int:
        return len(self.clearance)

    def __getitem__(
        self, rows: int | slice | NDArray[np.intp] | tuple[slice, NDArray[np.intp]]
    ) -> PredictedReadings:
        """Selects the readings of some of the bodies; after ``reshaped`` in the last axis, too."""
        return PredictedReadings(**{name: array[rows] for name, array in self._arrays()})

    def reshaped(self, *shape: int) -> PredictedReadings:
        """These readings, in arrays that begin with this shape in the place of (n,)."""
        return PredictedReadings(
            **{name: array.reshape(*shape, *array.shape[1:]) for name, array in self._arrays()}
        )

    @classmethod
    def empty(cls, count: int, sensors: int) -> PredictedReadings:
        """Invalid readings of ``count`` bodies, to be filled in."""
        return cls(
            touch=np.zeros((count, sensors), dtype=bool),
            touch_doubtful=np.zeros((count, sensors), dtype=bool),
            tilt=np.zeros((count, 2)),
            clearance=np.zeros(count),
            saturated=np.zeros(count, dtype=bool),
            speed=np.zeros(count),
            joint_miss=np.zeros(count),
            valid=np.zeros(count, dtype=bool),
            undecided=np.zeros(count, dtype=bool),
            stance=np.full(count, -1),
        )

    @classmethod
    def concatenate(cls, pieces: Iterable[PredictedReadings]) -> PredictedReadings:
        """Joins readings of bodies with equally many touch sensors, in the order given."""
        rows = list(pieces)
        if not rows:
            return cls.empty(0, 0)
        return cls(
            **{
                item.name: np.concatenate([getattr(piece, item.name) for piece in rows])
                for item in fields(cls)
            }
        )

    def _arrays(self) -> Iterator[tuple[str, NDArray[Any]]]:
        return ((item.name, getattr(self, item.name)) for item in fields(self))


def in_motor_order(angles: Mapping[str, float], capabilities: Capabilities) -> Program:
    """Angles by joint name as a motor program."""
    return tuple(angles[joint.name] for joint in capabilities.joints)


def same_program(one: Program, other: Program) -> bool:
    """Whether two motor programs are the same, whatever was rounded when one was written down."""
    return bool(np.allclose(one, other, rtol=0.0, atol=_SAME_ANGLE))


def by_joint_name(program: Program, capabilities: Capabilities) -> dict[str, float]:
    """A motor program as targets by joint name, as they go over the wire."""
    joints = capabilities.joints
    return {joint.name: angle for joint, angle in zip(joints, program, strict=True)}


def touched(sensors: Collection[int], observations: Sequence[Observation]) -> bool | None:
    """Whether a touch sensor among some met the ground in some interaction.

    Args:
        sensors: Indices of touch sensors.
        observations: The interactions.

    Returns:
        Whether one did; ``None`` where none of them was read.
    """
    bits = [
        observation.touch[sensor]
        for observation in observations
        for sensor in sensors
        if sensor < len(observation.touch)
    ]
    read_bits = [bit for bit in bits if bit is not None]
    return any(read_bits) if read_bits else None
