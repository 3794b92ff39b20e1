"""Bodies in the formats of simulators: URDF, MJCF and JSON, by name."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from enum import StrEnum
from types import MappingProxyType
from typing import Final
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from estimator.body.morphology import Morphology
from estimator.problem.problem import Problem
from estimator.report.export.description import Description, Joint, Link, Vector, describe
from protocol.wire.capabilities import Capabilities

_UPRIGHT: Final = "0 1.5707963267948966 0"  # turns a cylinder's axis from z to x
_STIFFNESS: Final = 100.0  # N·m/rad, of a servo
_DAMPING: Final = 1.0  # N·m·s/rad
_STEP: Final = 1 / 480  # s
_SKIN: Final = 0.002  # m, by which a touch sensor is larger than its link


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


def mjcf(body: Description) -> str:
    """The body as MJCF."""
    root = Element("mujoco", model=body.robot)
    SubElement(root, "compiler", angle="radian", eulerseq="XYZ")
    SubElement(root, "option", timestep=repr(_STEP), integrator="implicitfast")
    default = SubElement(root, "default")
    SubElement(default, "geom", contype="0", conaffinity="1", friction="0.7 0 0")
    world = SubElement(root, "worldbody")
    SubElement(world, "geom", type="plane", size="0 0 1", contype="1", conaffinity="0")
    belly = body.size[2] / 2
    main = SubElement(world, "body", name=body.base, pos=_numbers((0, 0, body.height)))
    SubElement(main, "freejoint")
    _add_mass(main, body.mass, body.inertia, body.centre)
    SubElement(main, "geom", type="box", size=_numbers(extent / 2 for extent in body.size))
    (c, s), (d, t) = ((math.cos(turn / 2), math.sin(turn / 2)) for turn in body.accelerometer)
    SubElement(main, "site", name="middle", quat=_numbers((c * d, s * d, c * t, s * t)))
    # A rangefinder looks along its site's z axis.
    SubElement(main, "site", name="belly", pos=_numbers((0, 0, -belly)), zaxis="0 0 -1")
    carriers = {body.base: main}
    for link in body.links:
        carriers[link.name] = _add_link(carriers[link.joint.parent], link)
    _add_servos(root, [link.joint for link in body.links])
    sensors = SubElement(root, "sensor")
    SubElement(sensors, "accelerometer", name="tilt", site="middle")
    SubElement(sensors, "rangefinder", name="clearance", site="belly")
    for link in sorted(body.links, key=lambda one: -1 if one.sensor is None else one.sensor):
        if link.sensor is not None:
            name = f"touch_{link.sensor + 1}"
            SubElement(sensors, "touch", name=name, site=_skin(link))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _add_link(carrier: Element, link: Link) -> Element:
    joint = link.joint
    element = SubElement(
        carrier, "body", name=link.name, pos=_numbers(joint.xyz), euler=_numbers(joint.rpy)
    )
    if joint.limits is not None:
        ends = _numbers((joint.limits.lower, joint.limits.upper))
        SubElement(element, "joint", name=joint.name, axis=_numbers(joint.axis), range=ends)
    _add_mass(element, link.mass, link.inertia, (link.middle, 0, 0))
    SubElement(element, "geom", _shape(link))
    if link.sensor is not None:
        SubElement(element, "site", _shape(link, _SKIN), name=_skin(link))
    return element


def _add_mass(element: Element, mass: float, inertia: Vector, centre: Vector) -> None:
    SubElement(
        element,
        "inertial",
        pos=_numbers(centre),
        mass=repr(mass),
        diaginertia=_numbers(inertia),
    )


def _shape(link: Link, larger: float = 0.0) -> dict[str, str]:
    """A link's shape, its surface so much farther out, m."""
    radius = link.radius + larger
    if link.shape == "box":
        half = _numbers(extent / 2 + larger for extent in link.box)
        return {"type": "box", "pos": _numbers((link.middle, 0, 0)), "size": half}
    if link.is_sphere:
        shape = {"type": "sphere", "pos": _numbers((link.far, 0, 0))}
    else:
        shape = {"type": "capsule", "fromto": _numbers((link.near, 0, 0, link.far, 0, 0))}
    return {**shape, "size": repr(radius)}


def _add_servos(root: Element, joints: Iterable[Joint]) -> None:
    actuators = SubElement(root, "actuator")
    for joint in joints:
        if joint.limits is not None:
            SubElement(
                actuators,
                "position",
                name=joint.name,
                joint=joint.name,
                kp=repr(_STIFFNESS),
                kv=repr(_DAMPING),
                ctrlrange=_numbers((joint.limits.lower, joint.limits.upper)),
                forcerange=_numbers((-joint.limits.effort, joint.limits.effort)),
            )


def _skin(link: Link) -> str:
    return f"{link.name}_skin"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def as_json(body: Description) -> str:
    """The fields of ``Description``."""
    return json.dumps(asdict(body), indent=2) + "\n"


class BodyFormat(StrEnum):
    """What a body can be written as."""

    URDF = "urdf"
    MJCF = "mjcf"
    JSON = "json"


BODY_FORMATS: Final[Mapping[BodyFormat, Callable[[Description], str]]] = MappingProxyType(
    {BodyFormat.URDF: urdf, BodyFormat.MJCF: mjcf, BodyFormat.JSON: as_json}
)


def in_words_of(problem: Problem, robot: Capabilities, body: Morphology) -> Description:
    """Describes a body with the problem's names for parts and the robot's for joints."""
    return describe(
        body,
        robot=robot.robot,
        parts=[rule.name for rule in problem.parts],
        carried=[rule.joint for rule in problem.parts],
        joints=robot.joints,
    )
