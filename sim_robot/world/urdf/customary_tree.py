"""How links hang together as others write it, taken as one main body and what it carries."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from operator import matmul

import numpy as np

from sim_robot.world.urdf.elements import (
    Element,
    Say,
    end,
    frame,
    joints_at,
    mass,
    set_end,
    set_frame,
)
from sim_robot.world.urdf.frames import Frame, inverse


def settle_tree(root: Element, *, note: Say) -> None:
    """Makes the main body the root, joins links without mass to others, and lists parents first.

    Args:
        root: The ``<robot>``; what is no tree is left for the checks to say.
        note: Told what is taken otherwise than it stands there.
    """
    _let_go(root, note)
    _make_root(root, lambda link: bool(mass(link)))  # that the old one is joined to it is said
    _join_massless(root, note)
    new = _make_root(root, _shaped)
    if new:
        note(f"link '{new}'", "is the main body: what it is fixed to has no shape")
    _show_instead(root, note)
    _list_parents_first(root, note)


def _let_go(root: Element, note: Say) -> None:
    """Removes the world that a robot floats in: every robot lies free here."""
    for joint in root.findall("joint"):
        world = _link(root, end(joint, "parent"))
        if joint.get("type") != "floating" or world is None:
            continue
        name = world.get("name", "")
        if _shaped(world) or joints_at(root, name, "child"):
            continue
        if len(joints_at(root, name, "parent")) > 1:
            continue
        root.remove(joint)
        root.remove(world)
        note(f"joint '{joint.get('name')}'", f"floats in '{name}', as every robot does here")


def _make_root(root: Element, wanted: Callable[[Element], bool]) -> str:
    """Turns the fixed joints between the root and the nearest link that is wanted as one.

    The new root is upright as the old one was: it has its axes.

    Returns:
        The name of the new root; empty where the old one stays.
    """
    top = _root(root)
    if top is None or wanted(top):
        return ""
    ways: list[tuple[str, list[Element]]] = [(top.get("name", ""), [])]
    seen = {top.get("name", "")}
    for name, way in ways:  # grows while it is gone through
        for joint in joints_at(root, name, "parent"):
            below = end(joint, "child")
            link = _link(root, below)
            if joint.get("type") != "fixed" or link is None or below in seen:
                continue
            if wanted(link):
                upright = reduce(matmul, map(frame, [*way, joint]))
                upright[:3, 3] = 0.0
                _turn(*way, joint)
                _give_axes(root, link, upright)
                return below
            seen.add(below)
            ways.append((below, [*way, joint]))
    return ""


def _turn(*joints: Element) -> None:
    for joint in joints:
        above, below = end(joint, "parent"), end(joint, "child")
        set_end(joint, "parent", below)
        set_end(joint, "child", above)
        set_frame(joint, inverse(frame(joint)))


def _give_axes(root: Element, link: Element, turn: Frame) -> None:
    """Turns the axes of a link back, so that all in it is turned instead."""
    if np.allclose(turn, np.eye(4)):
        return
    joints = joints_at(root, link.get("name", ""), "parent")
    for one in [*link.findall("inertial"), *link.findall("collision"), *link.findall("visual")]:
        set_frame(one, turn @ frame(one))
    for joint in joints:
        set_frame(joint, turn @ frame(joint))


def _show_instead(root: Element, note: Say) -> None:
    """Gives a main body that has only ``<visual>`` shapes those."""
    link = _root(root)
    if link is None or _shaped(link):
        return
    visuals = link.findall("visual")
    for visual in visuals:
        visual.tag = "collision"
        for material in visual.findall("material"):
            visual.remove(material)
    if visuals:
        note(f"link '{link.get('name')}'", "has no <collision>; its <visual> is taken for one")


def _join_massless(root: Element, note: Say) -> None:
    """Makes links without mass parts of what they are fixed to."""
    for joint in root.findall("joint"):
        above, below = (_link(root, end(joint, role)) for role in ("parent", "child"))
        if joint.get("type") != "fixed" or above is None or below is None or above is below:
            continue
        if mass(below):
            continue
        place = frame(joint)
        for collision in below.findall("collision"):
            set_frame(collision, place @ frame(collision))
            above.append(collision)
        _rehang(root, below.get("name", ""), above.get("name", ""), place)
        root.remove(joint)
        root.remove(below)
        note(
            f"link '{below.get('name')}'",
            f"has no mass and is taken as a part of '{above.get('name')}'",
        )


def _rehang(root: Element, old: str, new: str, place: Frame) -> None:
    for joint in joints_at(root, old, "parent"):
        set_end(joint, "parent", new)
        set_frame(joint, place @ frame(joint))


def _list_parents_first(root: Element, note: Say) -> None:
    """Moves joints behind those that carry them; motors are counted in this order."""
    joints = root.findall("joint")
    children = {end(joint, "child") for joint in joints}
    placed = {end(joint, "parent") for joint in joints} - children
    waiting, moved = list(joints), []
    while waiting:
        ready = next((joint for joint in waiting if end(joint, "parent") in placed), None)
        if ready is None:
            return  # a ring, or a link that is not there
        if ready is not waiting[0]:
            moved += [joint for joint in waiting[: waiting.index(ready)] if joint not in moved]
        waiting.remove(ready)
        placed.add(end(ready, "child"))
        root.append(ready)
    for joint in moved:
        if joint.get("type") != "fixed":
            where = f"joint '{joint.get('name')}'"
            note(where, "stands before the joint that carries it, and is counted after it")


def _root(root: Element) -> Element | None:
    """The link that is no joint's child, if there is one such."""
    children = {end(joint, "child") for joint in root.findall("joint")}
    tops = [link for link in root.findall("link") if link.get("name") not in children]
    return tops[0] if len(tops) == 1 else None


def _link(root: Element, name: str) -> Element | None:
    return next((link for link in root.findall("link") if link.get("name") == name), None)


def _shaped(link: Element) -> bool:
    return link.find("collision") is not None
