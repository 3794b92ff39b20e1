"""The subset of URDF that a simulated body may use, as declarations.

Boxes, cylinders and spheres; fixed and revolute joints; anything else unknown is refused. What an
engine gets is written from these declarations, so it never sees an element that was not checked.

Source: the URDF specification (http://wiki.ros.org/urdf/XML).
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import AfterValidator
from pydantic_xml import BaseXmlModel, attr, element


def vector(text: str) -> tuple[float, float, float]:
    """The three numbers of an attribute."""
    x, y, z = (float(word) for word in text.split())
    return x, y, z


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError("must be finite")
    return value


def _positive(value: float) -> float:
    if value <= 0:
        raise ValueError("must be above 0")
    return value


def _three(text: str) -> str:
    try:
        values = vector(text)
    except ValueError:
        raise ValueError(f"must be three numbers, not '{text}'") from None
    for value in values:
        _finite(value)
    return text


def _extents(text: str) -> str:
    for value in vector(_three(text)):
        _positive(value)
    return text


Finite = Annotated[float, AfterValidator(_finite)]
Positive = Annotated[float, AfterValidator(_finite), AfterValidator(_positive)]
Vector = Annotated[str, AfterValidator(_three)]
Extents = Annotated[str, AfterValidator(_extents)]


class _Element(BaseXmlModel, extra="forbid", search_mode="unordered", skip_empty=True):
    """Base: elements in any order, unknown ones refused."""


class Origin(_Element, tag="origin"):
    """A pose: position in m, roll-pitch-yaw in rad."""

    xyz: Vector = attr(default="0 0 0")
    rpy: Vector = attr(default="0 0 0")


class Mass(_Element, tag="mass"):
    """Kilograms."""

    value: Positive = attr()


class Inertia(_Element, tag="inertia"):
    """The inertia matrix about the centre of mass, kg·m²."""

    ixx: Finite = attr()
    ixy: Finite = attr(default=0.0)
    ixz: Finite = attr(default=0.0)
    iyy: Finite = attr()
    iyz: Finite = attr(default=0.0)
    izz: Finite = attr()


class Inertial(_Element, tag="inertial"):
    """Mass and where it sits."""

    origin: Origin = element(default_factory=Origin)
    mass: Mass = element()
    inertia: Inertia = element()


class Box(_Element, tag="box"):
    """Extents along x, y, z, m."""

    size: Extents = attr()


class Cylinder(_Element, tag="cylinder"):
    """Along z, centred."""

    radius: Positive = attr()
    length: Positive = attr()


class Sphere(_Element, tag="sphere"):
    """Centred."""

    radius: Positive = attr()


class Geometry(_Element, tag="geometry"):
    """Exactly one shape."""

    box: Box | None = element(default=None)
    cylinder: Cylinder | None = element(default=None)
    sphere: Sphere | None = element(default=None)

    @property
    def shape(self) -> Box | Cylinder | Sphere | None:
        """The shape, if there is exactly one."""
        shapes = [item for item in (self.box, self.cylinder, self.sphere) if item is not None]
        return shapes[0] if len(shapes) == 1 else None


class Collision(_Element, tag="collision"):
    """A shape that touches the ground."""

    name: str | None = attr(default=None)
    origin: Origin = element(default_factory=Origin)
    geometry: Geometry = element()


class Link(_Element, tag="link"):
    """A rigid part."""

    name: str = attr()
    inertial: Inertial | None = element(default=None)
    collisions: list[Collision] = element(tag="collision", default_factory=list)


class LinkName(_Element):
    """Names a link."""

    link: str = attr()


class Axis(_Element, tag="axis"):
    """The axis of a joint, in its own frame."""

    xyz: Vector = attr(default="1 0 0")


class Limit(_Element, tag="limit"):
    """Range in rad, torque in N·m, speed in rad/s."""

    lower: Finite = attr()
    upper: Finite = attr()
    effort: Positive = attr()
    velocity: Positive = attr()


class Dynamics(_Element, tag="dynamics"):
    """Passive friction of a joint; a servo overcomes it."""

    damping: Finite = attr(default=0.0)
    friction: Finite = attr(default=0.0)


class Joint(_Element, tag="joint"):
    """Joins a child link to its parent."""

    name: str = attr()
    type: Literal["fixed", "revolute"] = attr()
    parent: LinkName = element()
    child: LinkName = element()
    origin: Origin = element(default_factory=Origin)
    axis: Axis = element(default_factory=Axis)
    limit: Limit | None = element(default=None)
    dynamics: Dynamics | None = element(default=None)


class Robot(_Element, tag="robot"):
    """A whole file."""

    name: str = attr()
    version: str | None = attr(default=None)
    links: list[Link] = element(tag="link", default_factory=list)
    joints: list[Joint] = element(tag="joint", default_factory=list)
