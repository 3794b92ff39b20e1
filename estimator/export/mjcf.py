"""MJCF, MuJoCo's format (https://mujoco.readthedocs.io/en/stable/XMLreference.html).

The body stands planar on a plane, a position servo at each joint. Its sensors are the robot's:
``tilt`` is an accelerometer in the middle of the main body, ``clearance`` a rangefinder in the
middle of its lower face, and each ``touch_n`` covers its link. Parts touch the ground alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from estimator.export.description import Description, Joint, Link, Vector

_STIFFNESS: Final = 100.0  # N·m/rad, of a servo
_DAMPING: Final = 1.0  # N·m·s/rad
_STEP: Final = 1 / 480  # s
_SKIN: Final = 0.002  # m, by which a touch sensor is larger than its link


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
    _add_inertial(main, body.mass, body.inertia, body.centre)
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
    _add_inertial(element, link.mass, link.inertia, (link.middle, 0, 0))
    SubElement(element, "geom", _shape(link))
    if link.sensor is not None:
        SubElement(element, "site", _shape(link, _SKIN), name=_skin(link))
    return element


def _add_inertial(element: Element, mass: float, inertia: Vector, centre: Vector) -> None:
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
