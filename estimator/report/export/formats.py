"""Bodies in the formats of simulators and of ROS 2, by name."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import asdict
from enum import StrEnum
from types import MappingProxyType
from typing import Final, TypeAlias
from xml.etree import ElementTree
from xml.etree.ElementTree import Comment, Element, SubElement

from estimator.body.morphology import Morphology
from estimator.problem.problem import Problem
from estimator.report.export.description import Description, Joint, Limits, Link, Vector, describe
from estimator.report.export.ros2 import ros2_package
from protocol.wire.capabilities import Capabilities

_UPRIGHT: Final = "0 1.5707963267948966 0"  # turns a cylinder's axis from z to x
_TIMESTEP: Final = 1 / 480  # MuJoCo's time step, s
_SERVO_YIELD: Final = 0.02  # rad off its target, at which a servo gives its full torque; not tuned
_ROTOR_STEPS: Final = 3.0  # steps that a servo needs to react, without damping; not tuned
_SOFTNESS: Final = 3.0  # time constant of a contact, in steps; MuJoCo's least is 2
_IMPEDANCE: Final = "0.99 0.999 0.001 0.5 2"  # solimp: bodies sink in by some hundredths of a mm
_BELLY_DEPTH: Final = 0.0001  # m, by which the rangefinder lies inside; bodies sink in by less
_SKIN_THICKNESS: Final = 0.002  # m, by which a touch sensor is larger than its link
_COLOURS: Final = {"main body": "0.35 0.38 0.42 1", "part": "0.2 0.45 0.7 1"}


_SOLVER_REMARK: Final = (
    "The step and, below, armature belong together. Elliptic cones: friction is alike in all "
    "directions."
)
_CONTACT_REMARK: Final = (
    "Links touch the ground and not each other. The friction of a pair is the larger one. Contacts "
    "are as stiff as the step allows."
)
_CLEARANCE_REMARK: Final = (
    "Clearance is measured from 0.1 mm inside the belly, so a body that lies on it reads 0.1 mm. "
    "-1 is MuJoCo's value where there is no ground below."
)
_SERVO_REMARK: Final = (
    "Servos are position actuators, ctrl is the angle, rad: kp is the effort by 0.02 rad. Damping, "
    "the effort by the speed, lets a servo turn as fast as the robot's at most. armature is the "
    "inertia of a rotor behind gears, here what kp moves in 3 steps: without it light links "
    "hop, although nothing moves them."
)


def urdf(body: Description) -> str:
    """The body as URDF."""
    root = Element("robot", name=body.robot)
    _remark(root, *_body_remarks(body))
    for name, colour in _COLOURS.items():
        SubElement(SubElement(root, "material", name=name), "color", rgba=colour)
    main = SubElement(root, "link", name=body.base)
    _add_inertial(main, body.mass, body.inertia, body.centre)
    width, _, height = body.size
    if body.round:
        plate = SubElement(_collision(main, 0.0), "cylinder", radius=repr(width / 2))
        plate.set("length", repr(height))
    else:
        SubElement(_collision(main, 0.0), "box", size=_numbers(body.size))
    for link in body.links:
        element = SubElement(root, "link", name=link.name)
        _add_inertial(element, link.mass, link.inertia, (link.middle, 0, 0))
        _add_shape(element, link)
    for link_element in root.findall("link"):
        _make_visible(link_element, "main body" if link_element is main else "part")
    for link in body.links:
        _add_joint(root, link.joint, link.name)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _body_remarks(body: Description) -> Iterator[str]:
    """Sentences about the body that URDF and MJCF files hold as comments."""
    parts_mass = sum(link.mass for link in body.links)
    yield (
        f"Masses: the main body's {body.mass:.4g} kg are the robot's word; the other "
        f"{len(body.links)} links have {parts_mass:.4g} kg together, by their size and the density "
        f"of the run's problem. Inertia is that of even density. Units are m, rad, kg, N·m."
    )
    yield (
        "Limits of angle and speed are the robot's. Efforts are a guess, ample on purpose: the "
        "robot says nothing of them, and here each is twice the torque that holds the whole body "
        "at its full reach."
    )


def _remark(element: Element, *sentences: str) -> None:
    for sentence in sentences:
        element.append(Comment(f" {sentence} "))


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


def _make_visible(link: Element, material: str) -> None:
    """Adds to a link a visible copy of each of its collision shapes."""
    for number, collision in enumerate(link.findall("collision"), start=1):
        visual = deepcopy(collision)
        visual.tag = "visual"
        SubElement(visual, "material", name=material)
        link.insert(number, visual)


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
    """The body as MJCF, in a world where it stands still."""
    root = Element("mujoco", model=body.robot)
    _remark(root, *_body_remarks(body))
    SubElement(root, "compiler", angle="radian", eulerseq="XYZ")
    _remark(root, _SOLVER_REMARK)
    SubElement(root, "option", timestep=repr(_TIMESTEP), integrator="implicitfast", cone="elliptic")
    default = SubElement(root, "default")
    _remark(default, _CONTACT_REMARK)
    SubElement(
        default,
        "geom",
        contype="0",
        conaffinity="1",
        friction="0.7 0 0",
        solref=_numbers((_SOFTNESS * _TIMESTEP, 1)),
        solimp=_IMPEDANCE,
    )
    _remark(default, _SERVO_REMARK)
    world = SubElement(root, "worldbody")
    SubElement(world, "geom", type="plane", size="0 0 1", contype="1", conaffinity="0")
    width, _, belly = (extent / 2 for extent in body.size)
    main = SubElement(world, "body", name=body.base, pos=_numbers((0, 0, body.height)))
    SubElement(main, "freejoint")
    _add_mass(main, body.mass, body.inertia, body.centre)
    if body.round:
        SubElement(main, "geom", type="cylinder", size=_numbers((width, belly)))
    else:
        SubElement(main, "geom", type="box", size=_numbers(extent / 2 for extent in body.size))
    (c, s), (d, t) = ((math.cos(turn / 2), math.sin(turn / 2)) for turn in body.accelerometer)
    SubElement(main, "site", name="middle", quat=_numbers((c * d, s * d, c * t, s * t)))
    _remark(main, _CLEARANCE_REMARK)
    # A rangefinder looks along its site's z axis, and not at the body that carries it.
    eye = _numbers((0, 0, _BELLY_DEPTH - belly))
    SubElement(main, "site", name="belly", pos=eye, zaxis="0 0 -1")
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
        angle_range = _numbers((joint.limits.lower, joint.limits.upper))
        # At no load and full torque a servo of this damping turns at its highest speed.
        damping = joint.limits.effort / joint.limits.velocity
        SubElement(
            element,
            "joint",
            name=joint.name,
            axis=_numbers(joint.axis),
            range=angle_range,
            armature=repr(_stiffness(joint.limits) * (_ROTOR_STEPS * _TIMESTEP) ** 2),
            damping=repr(damping),
        )
    _add_mass(element, link.mass, link.inertia, (link.middle, 0, 0))
    SubElement(element, "geom", _shape(link))
    if link.sensor is not None:
        SubElement(element, "site", _shape(link, _SKIN_THICKNESS), name=_skin(link))
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
    """A link's shape as attributes of MJCF, its surface farther out by ``larger``, m."""
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
                kp=repr(_stiffness(joint.limits)),
                ctrlrange=_numbers((joint.limits.lower, joint.limits.upper)),
                forcerange=_numbers((-joint.limits.effort, joint.limits.effort)),
            )


def _stiffness(limits: Limits) -> float:
    """Stiffness of a servo, N·m/rad."""
    return limits.effort / _SERVO_YIELD


def _skin(link: Link) -> str:
    return f"{link.name}_skin"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def as_json(body: Description) -> str:
    """The body as JSON: the fields of ``Description``."""
    return json.dumps(asdict(body), indent=2) + "\n"


class BodyFormat(StrEnum):
    """Formats that a body can be written in."""

    URDF = "urdf"
    MJCF = "mjcf"
    JSON = "json"
    ROS2 = "ros2"


Exported: TypeAlias = str | Mapping[str, str]
"""Text of a single file, or texts of several files by their paths."""

BODY_FORMATS: Final[Mapping[BodyFormat, Callable[[Description], Exported]]] = MappingProxyType(
    {
        BodyFormat.URDF: urdf,
        BodyFormat.MJCF: mjcf,
        BodyFormat.JSON: as_json,
        BodyFormat.ROS2: lambda body: ros2_package(body, urdf(body)),
    }
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
