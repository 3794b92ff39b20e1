"""The subset of URDF that a simulated body may use, as declarations.

Boxes, cylinders and spheres; fixed and revolute joints. Visuals, materials and simulator hints are
dropped; anything else unknown is refused. What PyBullet loads is written from these declarations,
so it never sees an element that was not checked here.

Source: the URDF specification (http://wiki.ros.org/urdf/XML).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from lxml import etree
from pydantic import AfterValidator, ValidationError
from pydantic_xml import BaseXmlModel, attr, element

from sim_robot.errors import BodyError

_IGNORED = ("visual", "material", "gazebo", "transmission")
_LONGEST = 200  # characters of an attribute; PyBullet dies of a hundred thousand


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


def read_urdf(path: Path) -> Robot:
    """Parses a URDF file.

    Raises:
        BodyError: The file cannot be read, is no XML, or leaves the subset; names the element.
    """
    try:
        parser = etree.XMLParser(remove_comments=True, remove_pis=True, resolve_entities=False)
        root = etree.fromstring(path.read_bytes(), parser)
    except OSError as error:
        raise BodyError(str(path), "", f"cannot be read: {error.strerror}.") from error
    except etree.XMLSyntaxError as error:
        raise BodyError(str(path), "", f"is not valid XML: {error.msg}.") from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise BodyError(str(path), "<!DOCTYPE>", "is no part of URDF; leave it out, and entities.")
    if root.tag != "robot":
        raise BodyError(str(path), f"<{root.tag}>", "the root element must be <robot>.")
    for item in root.iter():
        if max((len(value) for value in item.attrib.values()), default=0) > _LONGEST:
            reason = f"no attribute may have more than {_LONGEST} characters."
            raise BodyError(str(path), f"<{item.tag}>", reason)
    for ignored in [item for tag in _IGNORED for item in root.iter(tag)]:
        parent = ignored.getparent()
        if parent is not None:
            parent.remove(ignored)
    for parent in root.iter():
        # The validator searches for elements by exchanging them with those that stand in their
        # place, so joints between links would come out of document order.
        parent[:] = sorted(parent, key=lambda child: child.tag in ("joint", "collision"))
    try:
        return Robot.from_xml_tree(root)  # type: ignore[arg-type]  # two sets of lxml types
    except ValidationError as error:
        first = error.errors()[0]
        reason = (
            first["msg"]
            .replace("Value error, ", "")
            .replace(
                "Extra inputs are not permitted",
                "is outside the subset (box, cylinder, sphere; fixed and revolute joints)",
            )
        )
        raise BodyError(str(path), _where(root, first["loc"]), f"{reason}.") from error


def _where(root: etree._Element, location: tuple[int | str, ...]) -> str:
    """Turns a validator's location into the names that stand in the file."""
    place = ""
    if len(location) > 1 and location[0] in ("links", "joints") and isinstance(location[1], int):
        tag = str(location[0])[:-1]
        name = root.findall(tag)[location[1]].get("name", f"number {location[1] + 1}")
        place = f"{tag} '{name}'"
        location = location[2:]
    inner = ".".join(str(part) for part in location if not isinstance(part, int))
    return ": ".join(part for part in (place, inner.replace("collisions", "collision")) if part)
