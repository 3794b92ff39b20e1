"""XML elements of a URDF file: their poses, numbers and ends, read and written.

What is no number reads as nothing here: the declarations say what is wrong with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TypeAlias

from lxml import etree

from sim_robot.world.urdf.declarations import vector
from sim_robot.world.urdf.frames import Frame, angles_of, frame_of

Element: TypeAlias = etree._Element
Say: TypeAlias = Callable[[str, str], None]
"""Is told an element and what is the matter with it."""


def frame(element: Element) -> Frame:
    """The pose of an element's ``<origin>``."""
    origin = element.find("origin")
    return frame_of(_triple(origin, "xyz"), _triple(origin, "rpy"))


def set_frame(element: Element, pose: Frame) -> None:
    """Gives an element another ``<origin>``."""
    for old in element.findall("origin"):
        element.remove(old)
    origin = etree.Element("origin", xyz=text_of(pose[:3, 3]), rpy=text_of(angles_of(pose)))
    element.insert(0, origin)


def text_of(values: Iterable[float]) -> str:
    """Numbers as an attribute has them."""
    return " ".join(repr(round(float(value), 12) + 0.0) for value in values)


def number(element: Element, name: str) -> float:
    """An attribute; NaN where it is none."""
    try:
        return float(element.get(name, ""))
    except ValueError:
        return math.nan


def mass(link: Element) -> float:
    """Mass of a link, kg; 0 without any."""
    element = link.find("inertial/mass")
    return 0.0 if element is None else number(element, "value")


def end(joint: Element, role: str) -> str:
    """The link that is a joint's ``parent`` or ``child``."""
    element = joint.find(role)
    return "" if element is None else element.get("link", "")


def set_end(joint: Element, role: str, link: str) -> None:
    """Hangs a joint elsewhere."""
    element = joint.find(role)
    if element is None:
        element = etree.SubElement(joint, role)
    element.set("link", link)


def joints_at(root: Element, link: str, role: str) -> list[Element]:
    """Joints that have a link as their ``parent``, or as their ``child``."""
    return [joint for joint in root.findall("joint") if end(joint, role) == link]


def _triple(origin: Element | None, name: str) -> tuple[float, float, float]:
    try:
        return vector("" if origin is None else origin.get(name, ""))
    except ValueError:
        return 0.0, 0.0, 0.0
