"""Faults that keep a body from being simulated although every value is right by itself.

They lie in the tree, the order, what belongs to what; in sizes and masses that no robot has.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from protocol.wire.field_checks import MAX_NAME
from sim_robot.world.urdf.declarations import (
    Box,
    Cylinder,
    Inertia,
    Joint,
    Link,
    Mesh,
    Robot,
    Sphere,
    vector,
)

MAX_MOTORS = 24  # outputs of three servo boards on one line
MAX_LINKS = 100  # PyBullet loads no body of 127
LONGEST = 10.0  # m; a robot in millimetres is longer
HEAVIEST = 1000.0  # kg; a robot in grams is heavier


def faults_of(robot: Robot, *, whole: bool) -> list[tuple[str, str]]:
    """Elements of a normalised body, and what is wrong with each.

    Args:
        robot: Links and joints of the body.
        whole: Whether all of these are there; else nothing is said of how they hang together.
    """
    faults = [*_names(robot)]
    moving = [joint for joint in robot.joints if joint.type != "fixed"]
    roots = [link.name for link in robot.roots] if whole else []
    if whole:
        faults += _tree(robot)
    for link in robot.links:
        faults += _link(link, root=link.name in roots, whole=whole)
    if whole and not 1 <= len(moving) <= MAX_MOTORS:
        reason = f"must have 1 to {MAX_MOTORS} revolute joints, not {len(moving)}."
        faults.append(("robot", reason))
    for joint in robot.joints:
        faults += _joint(joint)
    return faults


def _names(robot: Robot) -> Iterator[tuple[str, str]]:
    if not 1 <= len(robot.name) <= MAX_NAME:
        yield "robot: name", f"names have 1 to {MAX_NAME} characters."
    size = max(len(robot.links), len(robot.joints))
    if size > MAX_LINKS:
        yield "robot", f"must have at most {MAX_LINKS} links, not {size}."
    for kind, names in (
        ("link", Counter(link.name for link in robot.links)),
        ("joint", Counter(joint.name for joint in robot.joints)),
    ):
        for name, count in names.items():
            if count > 1:
                yield f"{kind} '{name}'", f"two {kind}s share this name."
            if not 1 <= len(name) <= MAX_NAME:
                yield f"{kind} '{name:.70}'", f"names have 1 to {MAX_NAME} characters."


def _tree(robot: Robot) -> Iterator[tuple[str, str]]:
    links = {link.name for link in robot.links}
    missing = [
        (f"joint '{joint.name}'", f"its {role} '{name}' is not a link of this file.")
        for joint in robot.joints
        for role, name in (("parent", joint.parent.link), ("child", joint.child.link))
        if name not in links
    ]
    yield from missing
    roots = [link.name for link in robot.roots]
    if len(roots) != 1:
        names = ", ".join(roots) or "none"
        yield "robot", f"must have exactly one link that is no joint's child; found: {names}."
    if missing:
        return
    placed = set(roots)
    for joint in robot.joints:
        where, child, parent = f"joint '{joint.name}'", joint.child.link, joint.parent.link
        if child in placed:
            yield where, f"its child '{child}' already hangs on another joint."
        elif parent not in placed:
            yield (
                where,
                f"its parent '{parent}' does not hang on the main body; the joints form a ring.",
            )
        placed.add(child)


def _link(link: Link, *, root: bool, whole: bool) -> Iterator[tuple[str, str]]:
    where, mass = f"link '{link.name}'", link.mass
    if whole and not mass:
        yield where, "needs <inertial> with a mass above 0."
    if mass > HEAVIEST:
        reason = f"is {mass:g} kg, and may be {HEAVIEST:g} at most: URDF has kilograms."
        yield f"{where}: mass", reason
    if link.inertial is not None:
        if link.inertial.inertia is not None and not _is_possible(link.inertial.inertia):
            yield (
                f"{where}: inertia",
                "is that of no rigid body: its principal moments must be 0 or more.",
            )
        yield from _extent(f"{where}: inertial: origin", *vector(link.inertial.origin.xyz))
    for collision in link.collisions:
        if collision.geometry.shape is None:
            place = f"{where}: collision: geometry"
            yield place, "must hold exactly one box, cylinder, sphere or mesh."
        else:
            yield from _extent(f"{where}: collision: geometry", *_sizes(collision.geometry.shape))
        yield from _extent(f"{where}: collision: origin", *vector(collision.origin.xyz))
    if root and not link.collisions:
        yield where, "the root link must have a shape, <collision>: it is the main body."


def _is_possible(inertia: Inertia) -> bool:
    moments = np.linalg.eigvalsh(inertia.matrix)
    return bool(moments.min() >= -1e-6 * abs(moments).max())


def _extent(where: str, *lengths: float) -> Iterator[tuple[str, str]]:
    longest = max(map(abs, lengths))
    if longest > LONGEST:
        reason = f"is {longest:g} m, and may be {LONGEST:g} at most: URDF has metres."
        yield where, reason


def _sizes(shape: Box | Cylinder | Sphere | Mesh) -> tuple[float, ...]:
    match shape:
        case Box():
            return vector(shape.size)
        case Cylinder():
            return shape.radius, shape.length
        case Sphere():
            return (shape.radius,)
        case Mesh():
            return (0.0,)  # the box around it is checked


def _joint(joint: Joint) -> Iterator[tuple[str, str]]:
    where, limit = f"joint '{joint.name}'", joint.limit
    yield from _extent(f"{where}: origin", *vector(joint.origin.xyz))
    if joint.mimic is not None:
        yield where, "follows another joint, <mimic>; make it fixed, or a servo of its own."
    if joint.type == "fixed":
        return
    if joint.type != "revolute":
        reason = f"is {joint.type}; only fixed, revolute and continuous joints are simulated."
        yield f"{where}: type", reason
        return
    if limit is None:
        yield where, "a revolute joint needs <limit>."
    elif not limit.lower < limit.upper:
        yield (
            f"{where}: limit",
            f"lower must be below upper, not {limit.lower:g} and {limit.upper:g}; what is left "
            "out is 0.",
        )
    if not any(vector(joint.axis.xyz)):
        yield f"{where}: axis", "must not be 0 0 0."
