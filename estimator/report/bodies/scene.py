"""Bodies as solids in the world, at rest in a pose of which only the readings are known.

Nothing is simulated here. The angles say where the parts are on the body, the tilt says which way
is up, and whatever is lowest lies on the ground; only the heading stays open, and is chosen so that
the body's front points along x. So a robot is shown as its own sensors describe it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal, Self, TypeAlias

import numpy as np

from estimator.body.morphology import Array, Morphology, part_frames, rotation
from estimator.evaluation.truth.urdf import Box, Cylinder, Origin, Sphere, Urdf, numbers
from estimator.readings.observation import Observation
from protocol.wire.readings import belly_ray, up_of

Kind: TypeAlias = Literal["box", "cylinder", "sphere"]
MAIN_BODY: Final = -1
"""In place of a limb's number: the solid belongs to the main body."""


@dataclass(frozen=True, kw_only=True)
class Solid:
    """One shape.

    Attributes:
        kind: Of shape.
        size: Box: its three extents; cylinder: radius and length (along z); sphere: radius; m.
        turn: Rotation, shape (3, 3).
        place: Of its middle, m, shape (3,).
        limb: Number of the limb that it belongs to, in motor order, or ``MAIN_BODY``.
    """

    kind: Kind
    size: tuple[float, ...]
    turn: Array
    place: Array
    limb: int

    def lowest(self, up: Array) -> float:
        """Its least extent along a direction, m, from the origin."""
        along = up @ self.turn
        if self.kind == "box":
            reach = float(np.abs(along) @ np.array(self.size)) / 2
        elif self.kind == "cylinder":
            radius, length = self.size
            reach = abs(along[2]) * length / 2 + math.hypot(along[0], along[1]) * radius
        else:
            reach = self.size[0]
        return float(up @ self.place) - reach


@dataclass(frozen=True, kw_only=True)
class Attitude:
    """What readings say of a pose.

    Attributes:
        tilt: Left/right and forward/back, rad.
        clearance: m; ``None`` where it was not read.
        saturated: Whether the ground lay beyond the sensor's range.
    """

    tilt: tuple[float, float]
    clearance: float | None
    saturated: bool

    @classmethod
    def of(cls, observation: Observation) -> Self | None:
        """What an interaction says of the pose; ``None`` where no tilt was read."""
        left, ahead = observation.tilt
        if left is None or ahead is None:
            return None
        return cls(
            tilt=(left, ahead),
            clearance=observation.clearance,
            saturated=observation.clearance_saturated,
        )


LEVEL: Final = Attitude(tilt=(0.0, 0.0), clearance=None, saturated=False)


def limb_numbers(body: Morphology) -> list[int]:
    """For each part the number of the limb that moves it, by which legs are coloured."""
    motors = sorted(part.motor for part in body.parts if part.motor is not None)
    moving = [body.parts[group].motor for group in body.rigid_groups]
    return [MAIN_BODY if motor is None else motors.index(motor) for motor in moving]


def model_solids(body: Morphology, angles: Sequence[float] | Array) -> list[Solid]:
    """A model in its own frame: capsules on a box."""
    origins, turns = part_frames(body, angles)
    lying = rotation((0.0, 1.0, 0.0), math.pi / 2)  # turns a cylinder from z to x
    solids = [
        Solid(kind="box", size=body.base.size, turn=np.eye(3), place=np.zeros(3), limb=MAIN_BODY)
    ]
    numbered = limb_numbers(body)
    for index, part in enumerate(body.parts):
        limb = numbered[index]
        ends = [
            origins[index] + turns[index][:, 0] * x for x in (part.near_centre, part.far_centre)
        ]
        straight = part.far_centre - part.near_centre
        solids += [
            Solid(kind="sphere", size=(part.radius,), turn=np.eye(3), place=end, limb=limb)
            for end in ends
        ]
        if straight > 0:
            solids.append(
                Solid(
                    kind="cylinder",
                    size=(part.radius, straight),
                    turn=turns[index] @ lying,
                    place=(ends[0] + ends[1]) / 2,
                    limb=limb,
                )
            )
    return solids


def robot_solids(
    urdf: Urdf, angles: Mapping[str, float], limbs_of: Mapping[str, int]
) -> list[Solid]:
    """A robot in its root link's frame.

    Args:
        urdf: Its body; parents come before children.
        angles: Of its joints, rad, by name.
        limbs_of: Number of the limb that each joint carries, by the joint's name.
    """
    frames = {urdf.root: (np.eye(3), np.zeros(3))}
    limbs = {urdf.root: MAIN_BODY}
    for joint in urdf.joints:
        turn, place = _inside(frames[joint.parent.link], joint.origin)
        if joint.type == "revolute":
            x, y, z = numbers(joint.axis.xyz)
            norm = math.hypot(x, y, z)
            axis = (x / norm, y / norm, z / norm)
            turn = turn @ rotation(axis, angles.get(joint.name, 0.0))
        frames[joint.child.link] = turn, place
        limbs[joint.child.link] = limbs_of.get(joint.name, limbs[joint.parent.link])
    solids = []
    for link in urdf.links:
        for collision in link.collisions:
            turn, place = _inside(frames[link.name], collision.origin)
            kind, size = shape_of(collision.geometry.shape)
            solids.append(
                Solid(kind=kind, size=size, turn=turn, place=place, limb=limbs[link.name])
            )
    return solids


def at_rest(solids: Sequence[Solid], attitude: Attitude) -> list[Solid]:
    """The solids of a body, moved from its own frame to where its readings say it rests."""
    turn = turn_at_rest(solids, attitude)
    lift = np.array([0.0, 0.0, -_lowest(solids, turn[2])])
    return [replace(item, turn=turn @ item.turn, place=turn @ item.place + lift) for item in solids]


def turn_at_rest(solids: Sequence[Solid], attitude: Attitude) -> Array:
    """Rotation from a body's own frame to the world's, where its readings say it rests."""
    up = _up(attitude, upright=True)
    if attitude.saturated and _belly_ray(solids, up) < (attitude.clearance or 0.0):
        up = _up(attitude, upright=False)
    ahead = np.array([1.0, 0.0, 0.0]) - up[0] * up
    ahead = ahead / np.linalg.norm(ahead)
    return np.array([ahead, np.cross(up, ahead), up])


def _up(attitude: Attitude, *, upright: bool) -> Array:
    """World up in the body's frame; the tilt leaves open whether the body lies on its back."""
    x, y, z = up_of(attitude.tilt)
    up = np.array([x, y, z if upright else -z])
    unit: Array = up / np.linalg.norm(up)
    return unit


def _lowest(solids: Sequence[Solid], up: Array) -> float:
    return min(item.lowest(up) for item in solids)


def _belly_ray(solids: Sequence[Solid], up: Array) -> float:
    """From the belly's middle to the ground, m, if the body rests with ``up``."""
    boxes = (item for item in solids if item.limb == MAIN_BODY and item.kind == "box")
    box = next(boxes, None)
    if box is None:  # a robot of another shape: nobody knows its belly
        return math.inf
    belly = box.place - np.array([0.0, 0.0, box.size[2] / 2])
    return belly_ray(float(up @ belly - _lowest(solids, up)), up)


def _inside(frame: tuple[Array, Array], origin: Origin) -> tuple[Array, Array]:
    (turn, place), (inner, at) = frame, frame_of(origin)
    return turn @ inner, place + turn @ at


def frame_of(origin: Origin) -> tuple[Array, Array]:
    """Rotation and place, m, that a URDF's origin stands for."""
    roll, pitch, yaw = numbers(origin.rpy)
    inner = rotation((0.0, 0.0, 1.0), yaw) @ rotation((0.0, 1.0, 0.0), pitch)
    inner = inner @ rotation((1.0, 0.0, 0.0), roll)
    return inner, np.array(numbers(origin.xyz))


def shape_of(shape: Box | Cylinder | Sphere | None) -> tuple[Kind, tuple[float, ...]]:
    """Kind and size of a URDF's shape, as a ``Solid`` has them."""
    if isinstance(shape, Box):
        return "box", numbers(shape.size)
    if isinstance(shape, Cylinder):
        return "cylinder", (shape.radius, shape.length)
    assert shape is not None
    return "sphere", (shape.radius,)
