"""A body as links and joints, from which every format is written.

Frames are those of ``estimator.body.morphology``: a link's origin lies on its joint's axis and x
runs along the link, away from its parent. Units are m, rad, kg, N·m.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.morphology import BASE, Array, Morphology, Part, PartShape, box_inertia
from protocol.text import printable
from protocol.wire.capabilities import Joint as RobotJoint

_GRAVITY: Final = 9.81
_AMPLE: Final = 2.0  # effort, relative to the torque that holds the whole body at its full reach
_MIN_STRAIGHT: Final = 1e-6  # m; a capsule whose centres are closer is a sphere

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a joint can do: range in rad, torque in N·m, speed in rad/s."""

    lower: float
    upper: float
    effort: float
    velocity: float


@dataclass(frozen=True, kw_only=True)
class Joint:
    """The joint by which a link hangs on its parent.

    Attributes:
        name: Name of the joint; the robot's own where it has this joint.
        parent: Name of the link that carries it.
        xyz: Position in the parent's frame, m.
        rpy: Orientation in the parent's frame: roll, pitch and yaw about its fixed axes, rad.
        axis: Axis of a positive rotation, in the link's frame.
        limits: What the joint can do; ``None``: it is fixed.
    """

    name: str
    parent: str
    xyz: Vector
    rpy: Vector
    axis: Vector
    limits: Limits | None


@dataclass(frozen=True, kw_only=True)
class Link:
    """One part and the joint that it hangs on.

    Attributes:
        name: Name of the link, unique in the body.
        joint: Joint between the link and its parent.
        shape: Shape of the link: a capsule or a box.
        near: Position of the near sphere's centre, or of the near face, on x, m.
        far: Position of the far sphere's centre, or of the far face, on x, m.
        radius: Radius, or half the width of a box, m.
        mass: Mass, kg.
        inertia: Moments of inertia along x, y and z about the centre of mass, which lies halfway
            between near and far, kg·m².
        sensor: Index of the touch sensor that it carries, or ``None``.
    """

    name: str
    joint: Joint
    shape: PartShape
    near: float
    far: float
    radius: float
    mass: float
    inertia: Vector
    sensor: int | None

    @property
    def middle(self) -> float:
        """Position of the centre of mass on x, m."""
        return (self.near + self.far) / 2

    @property
    def is_sphere(self) -> bool:
        """Whether it is a capsule so short that its two spheres are one."""
        return self.shape == "capsule" and self.far - self.near < _MIN_STRAIGHT

    @property
    def box(self) -> Vector:
        """Extent of a box along x, y and z, m."""
        return self.far - self.near, 2 * self.radius, 2 * self.radius


@dataclass(frozen=True, kw_only=True)
class Description:
    """A body as every format describes it.

    Attributes:
        robot: Name of the robot.
        base: Name of the main body: a box or an upright cylinder, in the middle of its frame.
        size: Extent of the main body along x, y and z, m.
        round: Whether the main body is a cylinder.
        mass: Mass of the main body, kg.
        inertia: Moments of inertia of the main body about its centre of mass, kg·m².
        centre: Centre of mass of the main body, from its middle, m.
        height: Height of the main body's middle above the ground with all joints at 0, m.
        accelerometer: How the accelerometer is turned on the main body, rad; see ``Base``.
        links: The links, parents before children; driven ones in the order of the robot's joints
            as far as that allows.
    """

    robot: str
    base: str
    size: Vector
    round: bool
    mass: float
    inertia: Vector
    centre: Vector
    height: float
    accelerometer: tuple[float, float]
    links: tuple[Link, ...]


def describe(
    body: Morphology,
    *,
    robot: str,
    parts: Sequence[str],
    carried: Sequence[int | None],
    joints: Sequence[RobotJoint],
) -> Description:
    """Describes a body in the robot's own names.

    A joint that the problem keeps at 0 is still described as a joint, if it is known which joint it
    is. A model's servos are strong enough by assumption, so efforts are ample.

    Args:
        body: The body.
        robot: The robot's name.
        parts: Name of each part.
        carried: Index of the joint that carries each part; ``None``: it is rigid on its parent.
        joints: The robot's joints.
    """
    joint_names = _different(
        joints[number].name if number is not None else f"{name}_fixed"
        for name, number in zip(parts, carried, strict=True)
    )
    base, *names = _different(["body", *parts])
    effort = _AMPLE * body.mass * _GRAVITY * body.reach
    angles = body.part_angles(np.zeros(body.motors))
    links = []
    for row in _in_order(body.parts, carried):
        part, number = body.parts[row], carried[row]
        parent = part.parent
        limits = None
        if number is not None:
            joint = joints[number]
            limits = Limits(
                lower=joint.lower, upper=joint.upper, effort=effort, velocity=joint.speed
            )
        mass = float(body.masses[row])
        links.append(
            Link(
                name=names[row],
                joint=Joint(
                    name=joint_names[row],
                    parent=base if parent == BASE else names[parent],
                    xyz=_vector(body.place(row)),
                    rpy=_angles(body.turn(row, angles[row])),
                    axis=body.hinge(row).axis,
                    limits=limits,
                ),
                shape=part.shape,
                near=part.near,
                far=part.far,
                radius=part.radius,
                mass=mass,
                inertia=_inertia(part, mass),
                sensor=part.sensor,
            )
        )
    return Description(
        robot=printable(robot),
        base=base,
        size=body.base.size,
        round=body.base.round,
        mass=body.base.mass,
        inertia=body.base.inertia,
        centre=_vector(body.base.centre),
        height=body.planar_height,
        accelerometer=body.base.accelerometer,
        links=tuple(links),
    )


def _in_order(parts: Sequence[Part], carried: Sequence[int | None]) -> list[int]:
    """Indices of parts, parents before children, otherwise by their joints; fixed ones first."""
    waiting, order = set(range(len(parts))), list[int]()
    while waiting:
        ready = [row for row in waiting if parts[row].parent not in waiting]
        order.append(min(ready, key=lambda row: (-1 if (at := carried[row]) is None else at, row)))
        waiting.remove(order[-1])
    return order


def _different(names: Iterable[str]) -> list[str]:
    """Names without spaces; one that occurred before gets a number."""
    unique_names: list[str] = []
    for name in names:
        base_name = re.sub(r"\s+", "_", printable(name))
        candidate, number = base_name, 2
        while candidate in unique_names:
            candidate, number = f"{base_name}_{number}", number + 1
        unique_names.append(candidate)
    return unique_names


def _inertia(part: Part, mass: float) -> Vector:
    """Moments of inertia of a part about its middle, along x, y and z, kg·m²."""
    if part.shape == "box":
        return box_inertia(part.size, mass)
    straight, radius = part.far - part.near, part.radius
    tube = mass * straight / (straight + 4 / 3 * radius)
    ends = mass - tube
    along = radius**2 * (tube / 2 + 2 / 5 * ends)
    across = tube * (straight**2 / 12 + radius**2 / 4)
    across += ends * (2 / 5 * radius**2 + straight**2 / 4 + 3 / 8 * straight * radius)
    return along, across, across


def _angles(turn: Array) -> Vector:
    """Roll, pitch and yaw of a rotation matrix about fixed axes, rad."""
    pitch = math.atan2(-turn[2, 0], math.hypot(turn[0, 0], turn[1, 0]))
    return _vector([math.atan2(turn[2, 1], turn[2, 2]), pitch, math.atan2(turn[1, 0], turn[0, 0])])


def _vector(values: Sequence[float] | Array) -> Vector:
    x, y, z = (float(value) + 0.0 for value in values)  # no negative zeros
    return x, y, z
