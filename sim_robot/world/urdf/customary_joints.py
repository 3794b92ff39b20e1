"""Joints as others write them, taken as servos: ranges, zeros, torques."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from lxml import etree

from sim_robot.world.urdf.declarations import vector
from sim_robot.world.urdf.elements import Element, Say, frame, number, set_frame
from sim_robot.world.urdf.frames import Frame

_TURN: Final = math.pi


def complete_joint(joint: Element, effort: float, *, note: Say, fault: Say) -> None:
    """Gives a joint what a servo has.

    Args:
        joint: Any joint; what is wrong with it is left for the declarations to say.
        effort: Torque where the joint has none, N·m.
        note: Told what is taken otherwise than it stands there.
        fault: Told what cannot be taken at all.
    """
    where = f"joint '{joint.get('name')}'"
    for mimic in joint.findall("mimic"):
        fault(where, "follows another joint, <mimic>; make it fixed, or a servo of its own.")
        joint.remove(mimic)
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
    for name in ("lower", "upper"):
        limit.set(name, limit.get(name, "0"))
    _count_from_zero(joint, limit, note)
    for name, sign in (("lower", -1), ("upper", 1)):
        if number(limit, name) * sign > _TURN + 0.01:
            limit.set(name, repr(sign * _TURN))
            note(f"{where}: limit", f"{name} lies beyond 180°, where servos end")
    if limit.get("effort") is None or number(limit, "effort") == 0:
        limit.set("effort", repr(effort))
        note(f"{where}: limit", f"no effort is taken as a servo of {effort:.3g} N·m")
    if limit.get("velocity") is None or number(limit, "velocity") == 0:
        limit.set("velocity", "1")  # servos turn at 60°/s, whatever it says


def _count_from_zero(joint: Element, limit: Element, note: Say) -> None:
    """Counts a range that does not hold 0 from its end that is nearest to it.

    Every interaction begins with all joints at 0; which way a servo's horn is screwed on is the
    builder's choice.
    """
    lower, upper = number(limit, "lower"), number(limit, "upper")
    zero = lower if lower > 0 else min(upper, 0.0)
    if zero == 0 or not (math.isfinite(lower) and lower < upper < math.inf):
        return
    element = joint.find("axis")
    try:
        axis = vector("1 0 0" if element is None else element.get("xyz", "1 0 0"))
    except ValueError:
        return
    if not any(axis):
        return
    set_frame(joint, frame(joint) @ _turned(np.array(axis), zero))
    limit.set("lower", repr(lower - zero))
    limit.set("upper", repr(upper - zero))
    low, high, here = (math.degrees(angle) for angle in (lower, upper, zero))
    note(
        f"joint '{joint.get('name')}'",
        f"turns from {low:.0f}° to {high:.0f}°, without 0, where interactions begin; its angle is "
        f"counted from {here:.1f}°",
    )


def _turned(axis: np.ndarray[tuple[int], np.dtype[np.float64]], angle: float) -> Frame:
    """The pose turned about an axis (Rodrigues)."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned = np.eye(4)
    turned[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return turned
