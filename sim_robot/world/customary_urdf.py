"""What URDF files of others have, rewritten into the subset; what that changes is said.

================================ ================================================================
In the file                      What it is taken as
================================ ================================================================
a mesh                           the box around it
a ``continuous`` joint           a revolute one of ±180°
limits beyond ±180°              ±180°
an effort of 0, or none          a servo that is strong enough: the robot's weight, two metres out
a link without mass, fixed       a part of the link that it is fixed to
a root without mass and shape    nothing: what is fixed to it is the root
================================ ================================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
from lxml import etree

from sim_robot.world.frames import Frame, angles_of, frame_of
from sim_robot.world.mesh_box import box_of_mesh, find_mesh
from sim_robot.world.urdf import vector

Element: TypeAlias = etree._Element
Say: TypeAlias = Callable[[str, str], None]
"""Is told an element and what is the matter with it."""

_SILENTLY: Final = ("visual", "material", "gazebo", "transmission")
_ALOUD: Final = ("contact", "joint_properties", "calibration", "safety_controller", "sensor")
_AMPLE: Final = 2.0 * 9.81  # N·m for each kg of the robot
_TURN: Final = math.pi


def rewrite(root: Element, file: Path, *, note: Say, fault: Say) -> None:
    """Rewrites a description in place.

    Args:
        root: Its ``<robot>``.
        file: Where it came from; meshes are looked for near it.
        note: Told what is taken otherwise than it stands there.
        fault: Told what cannot be taken at all.
    """
    for tag in (*_SILENTLY, *_ALOUD):
        ignored = list(root.iter(tag))
        for element in ignored:
            parent = element.getparent()
            if parent is not None:
                parent.remove(element)
        if ignored and tag in _ALOUD:
            note(f"<{tag}>", "is ignored")
    for link in root.findall("link"):
        _replace_meshes(link, file, note, fault)
    _join_massless(root, note)
    effort = _AMPLE * sum(_mass(link) for link in root.findall("link"))
    for joint in root.findall("joint"):
        _complete_joint(joint, effort, note)


def _replace_meshes(link: Element, file: Path, note: Say, fault: Say) -> None:
    for collision in link.findall("collision"):
        geometry = collision.find("geometry")
        mesh = None if geometry is None else geometry.find("mesh")
        if geometry is None or mesh is None:
            continue
        geometry.remove(mesh)
        where, name = f"link '{link.get('name')}': collision: mesh", mesh.get("filename", "")
        try:
            scale = [float(number) for number in mesh.get("scale", "1 1 1").split()]
            path = find_mesh(name, file)
            if path is None:
                raise ValueError("is not there")
            size, middle = box_of_mesh(path, scale)
        except (OSError, ValueError) as error:
            fault(where, f"{name} {getattr(error, 'strerror', None) or error}.")
            etree.SubElement(geometry, "box", size="1 1 1")  # so that it is said once
            continue
        etree.SubElement(geometry, "box", size=_text(np.maximum(size, 1e-4)))
        _set_frame(collision, _frame(collision) @ frame_of(middle))
        extents = " × ".join(f"{1000 * extent:.0f}" for extent in size)
        note(where, f"{Path(name).name} is taken as the box around it, {extents} mm")


def _join_massless(root: Element, note: Say) -> None:
    """Makes links without mass parts of what they are fixed to."""
    links = {link.get("name"): link for link in root.findall("link")}
    for joint in root.findall("joint"):
        above, below = (links.get(_end(joint, role)) for role in ("parent", "child"))
        if joint.get("type") != "fixed" or above is None or below is None or above is below:
            continue
        if not _mass(below):
            _move_shapes(below, above, _frame(joint))
            _rehang(root, below, above, _frame(joint))
            gone, stays = below, above
        elif not (_mass(above) or above.findall("collision") or _users(root, above, "child")):
            if len(_users(root, above, "parent")) > 1:
                continue
            gone, stays = above, below
        else:
            continue
        root.remove(joint)
        root.remove(gone)
        del links[gone.get("name")]
        note(
            f"link '{gone.get('name')}'",
            f"has no mass and is taken as a part of '{stays.get('name')}'",
        )


def _move_shapes(below: Element, above: Element, place: Frame) -> None:
    for collision in below.findall("collision"):
        _set_frame(collision, place @ _frame(collision))
        above.append(collision)


def _rehang(root: Element, below: Element, above: Element, place: Frame) -> None:
    for other in _users(root, below, "parent"):
        parent = other.find("parent")
        assert parent is not None
        parent.set("link", above.get("name", ""))
        _set_frame(other, place @ _frame(other))


def _users(root: Element, link: Element, role: str) -> list[Element]:
    """Joints that have a link as their parent, or as their child."""
    return [joint for joint in root.findall("joint") if _end(joint, role) == link.get("name")]


def _end(joint: Element, role: str) -> str | None:
    element = joint.find(role)
    return None if element is None else element.get("link")


def _mass(link: Element) -> float:
    mass = link.find("inertial/mass")
    try:
        return 0.0 if mass is None else float(mass.get("value", "0"))
    except ValueError:
        return math.nan  # its own check says so


def _complete_joint(joint: Element, effort: float, note: Say) -> None:
    where = f"joint '{joint.get('name')}'"
    limit = joint.find("limit")
    if joint.get("type") == "fixed":
        for element in joint.findall("limit"):
            joint.remove(element)
        return
    if joint.get("type") == "continuous":
        joint.set("type", "revolute")
        limit = etree.SubElement(joint, "limit") if limit is None else limit
        limit.set("lower", repr(-_TURN))
        limit.set("upper", repr(_TURN))
        note(where, "turns without end and is taken as a servo of ±180°")
    if joint.get("type") != "revolute" or limit is None:
        return
    for name, sign in (("lower", -1), ("upper", 1)):
        limit.set(name, limit.get(name, "0"))
        if _number(limit, name) * sign > _TURN + 0.01:
            limit.set(name, repr(sign * _TURN))
            note(f"{where}: limit", f"{name} lies beyond 180°, where servos end")
    if limit.get("effort") is None or _number(limit, "effort") == 0:
        limit.set("effort", repr(effort))
        note(f"{where}: limit", f"no effort is taken as a servo of {effort:.3g} N·m")
    if limit.get("velocity") is None or _number(limit, "velocity") == 0:
        limit.set("velocity", "1")  # servos turn at 60°/s, whatever it says


def _number(element: Element, name: str) -> float:
    try:
        return float(element.get(name, ""))
    except ValueError:
        return math.nan  # its own check says so


def _frame(element: Element) -> Frame:
    """The pose of an element's ``<origin>``."""
    origin = element.find("origin")
    return frame_of(_triple(origin, "xyz"), _triple(origin, "rpy"))


def _set_frame(element: Element, frame: Frame) -> None:
    for old in element.findall("origin"):
        element.remove(old)
    origin = etree.Element("origin", xyz=_text(frame[:3, 3]), rpy=_text(angles_of(frame)))
    element.insert(0, origin)


def _triple(origin: Element | None, name: str) -> tuple[float, float, float]:
    try:
        return vector("" if origin is None else origin.get(name, ""))
    except ValueError:
        return 0.0, 0.0, 0.0  # its own check says so


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(round(float(value), 12) + 0.0) for value in values)
