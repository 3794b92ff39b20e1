"""Makes the body that is simulated of what URDF files of others have; notes say what changes.

The table in ``docs/problems.md`` says what each thing that such files have is taken as.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from operator import matmul
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_robot.world.urdf.declarations import (
    Box,
    Collision,
    Cylinder,
    Frame,
    Geometry,
    Inertial,
    Joint,
    Limit,
    Link,
    Mesh,
    Origin,
    Robot,
    Say,
    frame_of,
    rotation,
    text_of,
    vector,
)
from sim_robot.world.urdf.inertia import mend_inertia
from sim_robot.world.urdf.meshes import box_of_mesh, find_mesh

_AMPLE_EFFORT: Final = 2.0 * 9.81  # N·m for each kg of the robot
_HALF_TURN: Final = math.pi
_MAX_RADIANS: Final = 2 * math.pi + 0.01  # what lies beyond is hardly meant in radians
_MIN_EXTENT: Final = 1e-4  # m
_UPRIGHT_TOLERANCE: Final = 1e-6  # by which the cosine of an upright axis may be below 1


def normalise(
    robot: Robot,
    file: Path,
    *,
    whole: bool,
    visual_faults: Mapping[str, Sequence[tuple[str, str]]],
    note: Say,
    fault: Say,
) -> None:
    """Makes the body that is simulated of what a file says, in place.

    Args:
        robot: Links and joints, all of them checked one by one.
        file: The URDF file; meshes are looked for near it.
        whole: Whether all links and joints are there; else how they hang together stays as it is.
        visual_faults: What is wrong with the ``<visual>`` of links, by their names.
        note: Told what is taken otherwise than it stands in the file.
        fault: Told what cannot be taken at all.
    """
    if whole:
        _arrange_tree(robot, note)
        main = _root(robot)
        if main is not None:
            _use_visuals(main, visual_faults.get(main.name, ()), note, fault)
    boxes = _MeshBoxes(file, fault)
    for link in robot.links:
        link.visuals = []
        for collision in link.collisions:
            if isinstance(collision.geometry.shape, Mesh):
                boxes.replace(link, collision, note)
        tensor = None if link.inertial is None else link.inertial.inertia
        if tensor is not None and tensor.iyx is not None:
            tensor.iyx = tensor.izx = tensor.izy = None
            note(f"link '{link.name}'", "has all nine entries of its inertia: iyx, izx, izy repeat")
    if whole:
        main = _root(robot)
        if main is not None:
            _make_simple(main, note)
        mend_inertia(robot, note)
    effort = _AMPLE_EFFORT * sum(link.mass for link in robot.links)
    for joint in robot.joints:
        _make_servo(joint, effort, note, fault)


# --- how links hang together ----------------------------------------------------------------------


def _arrange_tree(robot: Robot, note: Say) -> None:
    """Makes the main body the root, joins links without mass to others, and lists parents first."""
    _drop_world(robot, note)
    _make_root(robot, lambda link: link.mass > 0)  # joining the old one to it makes a note
    _join_massless(robot, note)
    new_root = _make_root(robot, lambda link: bool(link.collisions))
    if new_root:
        note(f"link '{new_root}'", "is the main body: what it is fixed to has no shape")
    _list_parents_first(robot, note)


def _drop_world(robot: Robot, note: Say) -> None:
    """Removes the world that a robot floats in: every robot lies free here."""
    for joint in list(robot.joints):
        name = joint.parent.link
        world = _link(robot, name)
        if joint.type != "floating" or world is None or world.collisions:
            continue
        if any(one.child.link == name for one in robot.joints):
            continue
        if len(_joints_on(robot, name)) == 1:
            _discard(robot.joints, joint)
            _discard(robot.links, world)
            note(f"joint '{joint.name}'", f"floats in '{name}', as every robot does here")


def _make_root(robot: Robot, wanted: Callable[[Link], bool]) -> str:
    """Makes the nearest wanted link that is fixed to the root the new root, turning their joints.

    The new root is upright as the old one was: it takes over its axes.

    Returns:
        The name of the new root; empty where the old one stays.
    """
    old_root = _root(robot)
    if old_root is None or wanted(old_root):
        return ""
    ways: list[tuple[str, list[Joint]]] = [(old_root.name, [])]
    seen_names = {old_root.name}
    for name, way in ways:  # grows while it is gone through
        for joint in _joints_on(robot, name):
            child_name = joint.child.link
            link = _link(robot, child_name)
            if joint.type != "fixed" or link is None or child_name in seen_names:
                continue
            if wanted(link):
                upright = reduce(matmul, (fixed.origin.frame for fixed in [*way, joint]))
                upright[:3, 3] = 0.0
                for fixed in [*way, joint]:
                    fixed.parent, fixed.child = fixed.child, fixed.parent
                    fixed.origin = Origin.at(np.linalg.inv(fixed.origin.frame).astype(float))
                _move_contents(robot, link, upright)
                return child_name
            seen_names.add(child_name)
            ways.append((child_name, [*way, joint]))
    return ""


def _move_contents(robot: Robot, link: Link, pose: Frame) -> None:
    """Moves all that is in a link, and all that hangs on it, by a pose."""
    if np.allclose(pose, np.eye(4)):
        return
    contents: list[Inertial | Collision | Joint] = [*link.collisions, *link.visuals]
    contents += [] if link.inertial is None else [link.inertial]
    for part in [*contents, *_joints_on(robot, link.name)]:
        part.origin = Origin.at(pose @ part.origin.frame)


def _join_massless(robot: Robot, note: Say) -> None:
    """Makes links without mass parts of what they are fixed to."""
    for joint in list(robot.joints):
        parent, child = _link(robot, joint.parent.link), _link(robot, joint.child.link)
        if joint.type != "fixed" or parent is None or child is None or parent is child:
            continue
        if child.mass or joint.mimic:
            continue
        _move_contents(robot, child, joint.origin.frame)
        parent.collisions += child.collisions
        for carried in _joints_on(robot, child.name):
            carried.parent.link = parent.name
        _discard(robot.joints, joint)
        _discard(robot.links, child)
        note(f"link '{child.name}'", f"has no mass and is taken as a part of '{parent.name}'")


def _use_visuals(
    main: Link, visual_faults: Sequence[tuple[str, str]], note: Say, fault: Say
) -> None:
    """Gives a main body without ``<collision>`` the shapes of its ``<visual>``."""
    if main.collisions or not (main.visuals or visual_faults):
        return
    for remark in visual_faults:
        fault(*remark)
    shapes = [Collision(origin=visual.origin, geometry=visual.geometry) for visual in main.visuals]
    main.collisions = shapes or [_stand_in()]
    note(f"link '{main.name}'", "has no <collision>; its <visual> is taken for one")


def _list_parents_first(robot: Robot, note: Say) -> None:
    """Moves joints behind those that carry them; motors are counted in this order."""
    placed = {joint.parent.link for joint in robot.joints}
    placed -= {joint.child.link for joint in robot.joints}
    waiting, listed, late = list(robot.joints), list[Joint](), dict[str, None]()
    while waiting:
        ready = next(
            (index for index, joint in enumerate(waiting) if joint.parent.link in placed), None
        )
        if ready is None:
            return  # a ring, or a link that is not there
        late |= {joint.name: None for joint in waiting[:ready] if joint.type != "fixed"}
        listed.append(waiting.pop(ready))
        placed.add(listed[-1].child.link)
    robot.joints = listed
    for name in late:
        note(f"joint '{name}'", "stands before the joint that carries it, and is counted after it")


def _root(robot: Robot) -> Link | None:
    """The link that is no joint's child, if there is one such."""
    roots = robot.roots
    return roots[0] if len(roots) == 1 else None


def _link(robot: Robot, name: str) -> Link | None:
    return next((link for link in robot.links if link.name == name), None)


def _joints_on(robot: Robot, link: str) -> list[Joint]:
    return [joint for joint in robot.joints if joint.parent.link == link]


def _discard(items: list[Joint] | list[Link], item: Joint | Link) -> None:
    """Removes an item, which others may equal."""
    del items[next(index for index, one in enumerate(items) if one is item)]


# --- shapes ---------------------------------------------------------------------------------------


class _MeshBoxes:
    """Puts the boxes around meshes in their place; a file that is used twice is read once.

    Args:
        file: The URDF file.
        fault: Told which mesh cannot be taken.
    """

    def __init__(self, file: Path, fault: Say):
        self._file = file
        self._fault = fault
        self._boxes: dict[Path, NDArray[np.float64]] = {}

    def replace(self, link: Link, collision: Collision, note: Say) -> None:
        """Puts a box in the place of a mesh."""
        mesh = collision.geometry.mesh
        assert mesh is not None
        where = f"link '{link.name}': collision: mesh"
        box_or_reason = self._box(mesh.filename)
        if isinstance(box_or_reason, str):
            self._fault(where, f"{mesh.filename} {box_or_reason}.")
            collision.geometry = _stand_in().geometry
            return
        corners = box_or_reason * vector(mesh.scale)
        size, middle = np.abs(corners[1] - corners[0]), corners.mean(axis=0)
        collision.geometry = Geometry(box=Box(size=text_of(np.maximum(size, _MIN_EXTENT))))
        collision.origin = Origin.at(collision.origin.frame @ frame_of(middle))
        name = Path(mesh.filename).name
        note(where, f"{name} is taken as the box around it, {_millimetres(size)} mm")

    def _box(self, filename: str) -> NDArray[np.float64] | str:
        """Least and greatest coordinates of a mesh, or what is wrong with it."""
        try:
            path = find_mesh(filename, self._file)
            if path is None:
                return "is not there"
            if path not in self._boxes:
                self._boxes[path] = box_of_mesh(path)
            return self._boxes[path]
        except (OSError, ValueError) as error:
            return str(getattr(error, "strerror", None) or error)


def _make_simple(main: Link, note: Say) -> None:
    """Makes a main body an upright cylinder, or one box along its axes around all its shapes."""
    shapes = [collision.geometry.shape for collision in main.collisions]
    if not shapes or None in shapes:
        return  # the checks refuse it
    first_collision = main.collisions[0]
    is_box = isinstance(shapes[0], Box) and len(shapes) == 1
    if is_box and not any(vector(first_collision.origin.rpy)):
        return
    is_upright = abs(first_collision.origin.frame[2, 2]) > 1 - _UPRIGHT_TOLERANCE
    if isinstance(shapes[0], Cylinder) and len(shapes) == 1 and is_upright:
        first_collision.origin = Origin(xyz=first_collision.origin.xyz)
        return
    bounds = np.array([collision.bounds(np.eye(4)) for collision in main.collisions])
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    main.collisions = [
        Collision(
            origin=Origin(xyz=text_of((low + high) / 2)),
            geometry=Geometry(box=Box(size=text_of(high - low))),
        )
    ]
    cosines = np.abs(first_collision.origin.frame[:3, :3])
    where, extents = f"link '{main.name}'", _millimetres(high - low)
    if is_box and np.allclose(cosines, np.round(cosines), atol=1e-6):
        note(where, f"is a box that is turned, and is written as {extents} mm without the turn")
        return
    note(
        where,
        f"is taken as the box around its shapes, {extents} mm, for main bodies are boxes or "
        "upright cylinders, here and in the estimator's models: on the ground it tips over the "
        "edges of that box, where the real one rolls or rests on other points; what is found of it "
        "holds for the real one only while its main body is off the ground, or lies flat",
    )


def _stand_in() -> Collision:
    """A shape in the place of one that is refused, so that its fault is told once."""
    return Collision(geometry=Geometry(box=Box(size="1 1 1")))


def _millimetres(size: NDArray[np.float64]) -> str:
    return " × ".join(f"{1000 * extent:.0f}" for extent in size)


# --- joints as servos -----------------------------------------------------------------------------


def _make_servo(joint: Joint, effort: float, note: Say, fault: Say) -> None:
    """Gives a joint what a servo has.

    Args:
        joint: Any joint.
        effort: Torque for a joint whose file gives none, N·m.
        note: Told what is taken otherwise than it stands in the file.
        fault: Told of limits that are no angles.
    """
    where = f"joint '{joint.name}'"
    if joint.type == "continuous":
        joint.type = "revolute"
        joint.limit = joint.limit or Limit()
        joint.limit.lower, joint.limit.upper = -_HALF_TURN, _HALF_TURN
        note(where, "turns without end and is taken as a servo of ±180°")
    limit = joint.limit
    if joint.type != "revolute" or limit is None:
        return
    if max(abs(limit.lower), abs(limit.upper)) > _MAX_RADIANS:
        _cut_limits(where, limit, note, fault)
    _count_from_zero(joint, limit, note)
    for name, sign in (("lower", -1), ("upper", 1)):
        if getattr(limit, name) * sign > _HALF_TURN + 0.01:
            setattr(limit, name, sign * _HALF_TURN)
            note(f"{where}: limit", f"{name} lies beyond 180°, where servos end")
    if not limit.effort:
        limit.effort = effort
        note(f"{where}:", f"an effort of 0, or none, is taken as a servo of {effort:.3g} N·m")
    limit.velocity = limit.velocity or 1.0  # servos turn at 60°/s, whatever it says


def _cut_limits(where: str, limit: Limit, note: Say, fault: Say) -> None:
    """Cuts limits that are hardly radians down to a servo's, if that leaves a range with 0."""
    lower, upper = limit.lower, limit.upper
    if lower > 0 or upper < 0:
        radians = f"{math.radians(lower):.4g} and {math.radians(upper):.4g}"
        reason = f"{lower:g} and {upper:g} are no angles in radians; for degrees, write {radians}."
        fault(f"{where}: limit", reason)
        limit.lower, limit.upper = -_HALF_TURN, _HALF_TURN  # so that it is said once
        return
    limit.lower, limit.upper = max(lower, -_HALF_TURN), min(upper, _HALF_TURN)
    note(
        f"{where}: limit",
        "lies beyond 360° and is cut to 180°: URDF has radians; if degrees are meant, write 1.571 "
        "for 90",
    )


def _count_from_zero(joint: Joint, limit: Limit, note: Say) -> None:
    """Counts a range that does not hold 0 from its end that is nearest to it.

    Every interaction begins with all joints at 0; which way a servo's horn is screwed on is the
    builder's choice.
    """
    lower, upper, axis = limit.lower, limit.upper, np.array(vector(joint.axis.xyz))
    zero = lower if lower > 0 else min(upper, 0.0)
    if zero == 0 or lower >= upper or not axis.any():
        return
    frame = joint.origin.frame
    frame[:3, :3] = frame[:3, :3] @ rotation(axis, zero)
    joint.origin = Origin.at(frame)
    limit.lower, limit.upper = lower - zero, upper - zero
    low, high, new_zero = (math.degrees(angle) for angle in (lower, upper, zero))
    note(
        f"joint '{joint.name}'",
        f"turns from {low:.0f}° to {high:.0f}°, without 0, where interactions begin; its angle is "
        f"counted from {new_zero:.1f}°",
    )
