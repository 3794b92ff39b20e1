"""URDF (http://wiki.ros.org/urdf/XML), in the subset that ``sim-robotd --body`` takes.

URDF has no capsules, so one is a cylinder with a sphere at each end. It has no sensors either:
a simulated robot has its accelerometer in the root link, its distance sensor in the middle of that
link's lower face, and a touch sensor on each link that carries no other joint.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from estimator.export.description import Description, Joint, Link, Vector

_UPRIGHT: Final = "0 1.5707963267948966 0"  # turns a cylinder's axis from z to x


def urdf(body: Description) -> str:
    """The body as URDF."""
    root = Element("robot", name=body.robot)
    main = SubElement(root, "link", name=body.base)
    _add_inertial(main, body.mass, body.inertia, body.centre)
    box = SubElement(_collision(main, 0.0), "box")
    box.set("size", _numbers(body.size))
    for link in body.links:
        element = SubElement(root, "link", name=link.name)
        _add_inertial(element, link.mass, link.inertia, (link.middle, 0, 0))
        _add_shape(element, link)
    for link in body.links:
        _add_joint(root, link.joint, link.name)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _add_inertial(link: Element, mass: float, inertia: Vector, centre: Vector) -> None:
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_numbers(centre))
    SubElement(inertial, "mass", value=repr(mass))
    xx, yy, zz = map(repr, inertia)
    SubElement(inertial, "inertia", ixx=xx, ixy="0", ixz="0", iyy=yy, iyz="0", izz=zz)


def _add_shape(element: Element, link: Link) -> None:
    if link.shape == "box":
        SubElement(_collision(element, link.middle), "box", size=_numbers(link.box))
        return
    if not link.is_sphere:
        tube = SubElement(_collision(element, link.middle, _UPRIGHT), "cylinder")
        tube.set("radius", repr(link.radius))
        tube.set("length", repr(link.far - link.near))
        SubElement(_collision(element, link.near), "sphere", radius=repr(link.radius))
    SubElement(_collision(element, link.far), "sphere", radius=repr(link.radius))


def _collision(link: Element, x: float, rpy: str = "0 0 0") -> Element:
    collision = SubElement(link, "collision")
    SubElement(collision, "origin", xyz=_numbers((x, 0, 0)), rpy=rpy)
    return SubElement(collision, "geometry")


def _add_joint(root: Element, joint: Joint, child: str) -> None:
    kind = "fixed" if joint.limits is None else "revolute"
    element = SubElement(root, "joint", name=joint.name, type=kind)
    SubElement(element, "parent", link=joint.parent)
    SubElement(element, "child", link=child)
    SubElement(element, "origin", xyz=_numbers(joint.xyz), rpy=_numbers(joint.rpy))
    if joint.limits is not None:
        SubElement(element, "axis", xyz=_numbers(joint.axis))
        limits = {name: repr(value) for name, value in vars(joint.limits).items()}
        SubElement(element, "limit", limits)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
