"""Reads a URDF as limbs with parent, mount, hinge and length, as a genome describes bodies.

Links joined by joints that nobody asks for are one limb. A limb's mount is the one nearest to its
joint, its hinge the one whose axis is nearest, its length the distance from joint to far end. Where
the nearest mount or hinge is not what the body has, no genome can be right, and the limb says so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from estimator.body.limbs import Limb
from estimator.body.morphology import BASE, Array, direction
from estimator.body.mounts import BaseMount
from estimator.errors import TruthError
from estimator.evaluation.truth.urdf import (
    Box,
    Collision,
    Cylinder,
    Urdf,
    numbers,
    read_urdf,
)
from estimator.problem.attachment_tables import PAPERS_TABLES, AttachmentTables
from protocol.wire.capabilities import Capabilities

PLACE_TOLERANCE: Final = 5e-3  # m
ANGLE_TOLERANCE: Final = math.radians(5.0)


@dataclass(frozen=True, kw_only=True)
class TrueLimb:
    """A limb of the true body.

    Attributes:
        name: Name of the joint that carries the limb.
        limb: The nearest limb that a genome can describe; its sensors are unknown.
        mount: Number of the limb's mount among those of the main body, or of parts.
        hinge: Number of the limb's hinge.
        not_representable: For each trait (``mount``, ``hinge``) that no genome has right, a
            sentence that says why.
    """

    name: str
    limb: Limb
    mount: int
    hinge: int
    not_representable: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class _Pose:
    """A frame: rotation, shape (3, 3), and place, m, shape (3,), in its parent's frame."""

    turn: Array
    place: Array

    def __matmul__(self, inner: _Pose) -> _Pose:
        return _Pose(self.turn @ inner.turn, self.place + self.turn @ inner.place)

    def into(self, outer: _Pose) -> _Pose:
        """This frame as seen from another one."""
        return _Pose(outer.turn.T @ self.turn, outer.turn.T @ (self.place - outer.place))


def true_limbs(
    path: Path, motors: Mapping[str, int], tables: AttachmentTables = PAPERS_TABLES
) -> tuple[TrueLimb, ...]:
    """Reads a URDF as limbs in motor order.

    Args:
        path: The URDF file.
        motors: Names of the joints that carry a limb, with the numbers by which the limbs are
            known: the motors, or any other way of counting.
        tables: The mounts and hinges that a genome can name.

    Raises:
        TruthError: The file is no URDF of the supported subset, or lacks one of the joints.
    """
    urdf = read_urdf(path)
    missing = sorted(motors.keys() - {joint.name for joint in urdf.joints})
    if missing:
        raise TruthError(
            f"{path} has no revolute joint named {', '.join(missing)}: give the URDF of the robot "
            "that the run talked to."
        )
    return _Reader(urdf, motors, tables).limbs()


def rigid_parts(
    path: Path, carried: Mapping[str, int], rigid: Mapping[int, Sequence[int]]
) -> dict[str, int]:
    """Fixed joints that hold the parts which a problem has rigid on others, with their numbers.

    On each part the robot's are taken in the order of the file, provided that there are as many.
    Frames and round feet, which point nowhere, are no parts.

    Args:
        path: The URDF file.
        carried: Names of the joints that carry a part, with its number.
        rigid: For each part, or the main body, the numbers of those that are rigid on it.

    Raises:
        TruthError: The file is no URDF of the supported subset.
    """
    urdf = read_urdf(path)
    long = {link.name for link in urdf.links if not all(c.geometry.sphere for c in link.collisions)}

    def held_by(link: str, part: int) -> Iterator[tuple[str, int]]:
        held = [
            joint
            for joint in urdf.joints
            if joint.type == "fixed" and joint.parent.link == link and joint.child.link in long
        ]
        if len(held) == len(rigid.get(part, ())):
            for joint, number in zip(held, rigid.get(part, ()), strict=True):
                yield joint.name, number
                yield from held_by(joint.child.link, number)

    parts = {
        joint.child.link: carried[joint.name] for joint in urdf.joints if joint.name in carried
    }
    return {
        name: number
        for link, part in {urdf.root: BASE, **parts}.items()
        for name, number in held_by(link, part)
    }


class _Reader:
    """Walks the tree once: poses of links in the planar pose, and which limb each belongs to."""

    def __init__(self, urdf: Urdf, motors: Mapping[str, int], tables: AttachmentTables):
        self._motors = motors
        self._tables = tables
        self._links = {link.name: link for link in urdf.links}
        self._base_size, middle, _ = urdf.main_body
        self._poses = {urdf.root: _Pose(np.eye(3), -np.array(middle))}  # as seen from the box
        self._limb_of = {urdf.root: BASE}
        self._driven = []
        for joint in urdf.joints:
            pose = self._poses[joint.parent.link] @ _Pose(*joint.origin.frame)
            self._poses[joint.child.link] = pose
            motor = motors.get(joint.name, self._limb_of[joint.parent.link])
            self._limb_of[joint.child.link] = motor
            if joint.name in motors:
                self._driven.append(joint)

    def limbs(self) -> tuple[TrueLimb, ...]:
        frames = {BASE: _Pose(np.eye(3), np.zeros(3))}  # parents come first in document order
        lengths: dict[int, float] = {}
        by_motor: dict[int, TrueLimb] = {}
        axes = np.array([hinge.axis for hinge in self._tables.hinges])
        for joint in self._driven:
            motor = self._motors[joint.name]
            parent = self._limb_of[joint.parent.link]
            pose = self._poses[joint.child.link]
            inside = pose.into(frames[parent])
            places = self._places(parent, lengths)
            pointing, length, slant = self._direction(motor, pose.place, frames[parent], places)
            mount, offset = _nearest_mount(inside.place, places, pointing)
            frames[motor] = _Pose(frames[parent].turn @ direction(places[pointing]), pose.place)
            axis = frames[motor].turn.T @ pose.turn @ _unit(numbers(joint.axis.xyz))
            hinge, twist = _nearest(axis, axes)
            lengths[motor] = length
            limb = Limb(
                motor=motor,
                parent=parent,
                mount=places[mount].name,
                hinge=self._tables.hinges[hinge].name,
                length=length,
            )
            turn = _between(places[pointing], places[mount])
            by_motor[motor] = TrueLimb(
                name=joint.name,
                limb=limb,
                mount=mount,
                hinge=hinge,
                not_representable=_misfits(
                    limb,
                    joint.name,
                    offset=offset,
                    turn=turn,
                    pointing=places[pointing].name,
                    slant=slant,
                    twist=twist,
                ),
            )
        return tuple(by_motor[motor] for motor in sorted(by_motor))

    def _places(self, parent: int, lengths: Mapping[int, float]) -> Sequence[BaseMount]:
        """Mounts on a parent, all in the parent's frame."""
        if parent == BASE:
            return self._tables.base_mounts(self._base_size)
        return [
            BaseMount(
                name=mount.name,
                at=(mount.fraction * lengths[parent], 0, 0),
                yaw=mount.yaw,
                elevation=mount.elevation,
            )
            for mount in self._tables.part_mounts
        ]

    def _direction(
        self, motor: int, start: Array, parent: _Pose, places: Sequence[BaseMount]
    ) -> tuple[int, float, float]:
        """Number of the mount nearest in direction to a limb, reach that way, m, and angle, rad.

        A limb points to the middle of its furthest shape, so that a wide foot does not turn a leg.
        """
        origin = parent.turn.T @ (start - parent.place)
        ways = np.array([parent.turn @ direction(place)[:, 0] for place in places])
        shapes = [
            (self._poses[name] @ _Pose(*collision.origin.frame), collision)
            for name, link in self._links.items()
            if self._limb_of[name] == motor
            for collision in link.collisions
        ]
        if not shapes:
            return 0, 0.0, 0.0
        reach = [max(_reach(pose, shape, start, way) for pose, shape in shapes) for way in ways]
        tip = max((pose.place - start for pose, _ in shapes), key=lambda offset: offset @ offset)
        distance = float(np.linalg.norm(tip))
        if distance <= PLACE_TOLERANCE:
            pointing, slant = int(np.argmax(reach)), 0.0
        else:
            _, slant = _nearest(tip / distance, ways)
            alike = np.flatnonzero(ways @ tip / distance >= math.cos(slant) - 1e-9)
            distances = [float(np.linalg.norm(origin - places[way].at)) for way in alike.tolist()]
            pointing = int(alike[np.argmin(distances)])  # of several that hang down, the nearest
        return pointing, max(0.0, reach[pointing]), slant


def _nearest_mount(place: Array, places: Sequence[BaseMount], pointing: int) -> tuple[int, float]:
    """Number of the nearest mount and how far off it is, m.

    Of several in one place it is the one whose direction is nearest to the limb's.

    Args:
        place: Place of the joint.
        places: The mounts.
        pointing: Number of a mount with the limb's direction.
    """
    distances = np.linalg.norm(np.array([mount.at for mount in places]) - place, axis=1)
    turns = np.array([_between(places[pointing], mount) for mount in places])
    nearest = np.flatnonzero(distances <= distances.min() + 1e-9)
    mount = int(nearest[np.argmin(turns[nearest])])
    return mount, float(distances[mount])


def _misfits(
    limb: Limb,
    name: str,
    *,
    offset: float,
    turn: float,
    pointing: str,
    slant: float,
    twist: float,
) -> dict[str, str]:
    misfits = {}
    if offset > PLACE_TOLERANCE:
        misfits["mount"] = (
            f"{name} sits {offset * 1000:.0f} mm from the nearest place that a genome can name, "
            f"{limb.mount}"
        )
    elif slant > ANGLE_TOLERANCE:
        misfits["mount"] = f"{name} points {math.degrees(slant):.0f} degrees away from {pointing}"
    elif turn > ANGLE_TOLERANCE:
        misfits["mount"] = f"{name} sits on the {limb.mount} but points {pointing}"
    if twist > ANGLE_TOLERANCE:
        misfits["hinge"] = (
            f"{name} has its axis {math.degrees(twist):.0f} degrees from that of the nearest "
            f"hinge, {limb.hinge}"
        )
    return misfits


def _reach(pose: _Pose, collision: Collision, start: Array, way: Array) -> float:
    """How far a shape extends from ``start`` in the direction ``way``, m."""
    inside = pose.turn.T @ way
    shape = collision.geometry.shape
    if isinstance(shape, Box):
        extent = float(np.abs(inside) @ np.array(numbers(shape.size))) / 2
    elif isinstance(shape, Cylinder):
        extent = abs(inside[2]) * shape.length / 2 + math.hypot(*inside[:2]) * shape.radius
    else:
        extent = shape.radius if shape else 0.0
    return float((pose.place - start) @ way) + float(extent)


def _unit(vector: tuple[float, float, float]) -> Array:
    return np.array(vector) / math.hypot(*vector)


def _nearest(way: Array, choices: Array) -> tuple[int, float]:
    """Number of the choice that is nearest in direction to ``way``, and the angle between, rad."""
    index = int(np.argmax(choices @ way))
    return index, _angle(choices[index], way)


def _between(one: BaseMount, other: BaseMount) -> float:
    """The angle between the directions of two mounts, rad."""
    return _angle(direction(one)[:, 0], direction(other)[:, 0])


def _angle(one: Array, other: Array) -> float:
    return math.acos(float(np.clip(one @ other, -1.0, 1.0)))


_SIZE: Final = 0.005
"""Largest difference of a main body's size from what its robot says, m; people measured both."""

_MASS: Final = 0.1
"""Largest relative difference of a main body's mass from what its robot says."""


def check_robot(path: Path, robot: Capabilities) -> None:
    """Refuses another robot's URDF.

    Raises:
        TruthError: The file is no URDF of the supported subset, or has other joints, or a main body
            of another size or mass.
    """
    urdf = read_urdf(path)
    joints = tuple(joint.name for joint in urdf.joints if joint.type == "revolute")
    announced = tuple(joint.name for joint in robot.joints)
    if joints != announced:
        raise _refusal(path, robot, f"the joints {', '.join(joints)}", ", ".join(announced))
    size, _, is_round = urdf.main_body
    root = next(link for link in urdf.links if link.name == urdf.root)
    mass = None if root.inertial is None else root.inertial.mass.value
    if not np.allclose(size, robot.base_size, rtol=0.0, atol=_SIZE):
        raise _refusal(path, robot, f"a main body of {_mm(size)} mm", f"{_mm(robot.base_size)} mm")
    if is_round != (robot.base_radius is not None):
        shapes = ("a round main body", "a box")
        raise _refusal(path, robot, *(shapes if is_round else reversed(shapes)))
    if mass is not None and not np.isclose(mass, robot.base_mass, rtol=_MASS, atol=0.0):
        raise _refusal(path, robot, f"a main body of {mass:g} kg", f"{robot.base_mass:g} kg")


def _refusal(path: Path, robot: Capabilities, there: str, here: str) -> TruthError:
    return TruthError(
        f"{path} is another robot's: it has {there}, and {robot.robot}, which the run talked to, "
        f"{here}: give the URDF of that robot."
    )


def _mm(size: Sequence[float]) -> str:
    return " x ".join(f"{length * 1000:.0f}" for length in size)
