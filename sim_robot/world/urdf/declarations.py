"""What a URDF file says, as declarations: every value is checked before anything is made of it.

They are URDF's, as far as a body depends on them: boxes, cylinders, spheres and meshes, all six
kinds of joints. ``normalisation`` makes a simulated body of them, ``checks`` says what none can be
made of. What an engine gets is written from these declarations, so it never sees an element that
was not checked.

Source: the URDF specification (http://wiki.ros.org/urdf/XML).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, model_validator
from pydantic_xml import BaseXmlModel, attr, element

Frame: TypeAlias = NDArray[np.float64]
"""Shape (4, 4): a pose in another frame."""

Points: TypeAlias = NDArray[np.float64]
"""Shape (…, 3): positions, m."""

Say: TypeAlias = Callable[[str, str], None]
"""Called with an element and what is the matter with it."""


def vector(text: str) -> tuple[float, float, float]:
    """The three numbers of an attribute."""
    x, y, z = (float(word) for word in text.split())
    return x, y, z


def text_of(values: Iterable[float]) -> str:
    """Text of an attribute that has these numbers."""
    return " ".join(repr(round(float(value), 12) + 0.0) for value in values)


def frame_of(xyz: Sequence[float] | Points, rpy: Sequence[float] = (0.0, 0.0, 0.0)) -> Frame:
    """The pose at a position (m), turned by roll, pitch and yaw (rad) about x, y and z, fixed."""
    frame = np.eye(4)
    for axis, angle in enumerate(rpy):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(4)
        turn[u, u] = turn[v, v] = math.cos(angle)
        turn[v, u] = math.sin(angle)
        turn[u, v] = -turn[v, u]
        frame = turn @ frame
    frame[:3, 3] = xyz
    return frame


def rotation(axis: Sequence[float] | Points, angle: float) -> Points:
    """The rotation about an axis by an angle, rad, shape (3, 3); Rodrigues' formula."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn: Points = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return turn


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError("must be finite")
    return value


def _positive(value: float) -> float:
    if value <= 0:
        raise ValueError("must be above 0")
    return value


def _not_negative(value: float) -> float:
    if value < 0:
        raise ValueError(f"must not be below 0, as {value:g} is")
    return value


def _three_numbers(text: str) -> str:
    try:
        values = vector(text)
    except ValueError:
        raise ValueError(f"must be three numbers with spaces between, not '{text}'") from None
    for value in values:
        _finite(value)
    return text


def _extents(text: str) -> str:
    for value in vector(_three_numbers(text)):
        _positive(value)
    return text


def _scale(text: str) -> str:
    if not all(vector(_three_numbers(text))):
        raise ValueError("must not be 0")
    return text


Finite = Annotated[float, AfterValidator(_finite)]
Positive = Annotated[float, AfterValidator(_finite), AfterValidator(_positive)]
NotNegative = Annotated[float, AfterValidator(_finite), AfterValidator(_not_negative)]
Vector = Annotated[str, AfterValidator(_three_numbers)]
Extents = Annotated[str, AfterValidator(_extents)]
Scale = Annotated[str, AfterValidator(_scale)]


class _Element(BaseXmlModel, extra="forbid", search_mode="unordered", skip_empty=True):
    """Base class: elements in any order, unknown ones refused."""


class Origin(_Element, tag="origin"):
    """A pose: position in m, roll-pitch-yaw in rad."""

    xyz: Vector = attr(default="0 0 0")
    rpy: Vector = attr(default="0 0 0")

    @property
    def frame(self) -> Frame:
        """The pose as a matrix."""
        return frame_of(vector(self.xyz), vector(self.rpy))

    @classmethod
    def at(cls, frame: Frame) -> Origin:
        """The origin at a pose that is given as a matrix."""
        level = math.hypot(frame[0, 0], frame[1, 0])
        pitch = math.atan2(-frame[2, 0], level)
        if level > 1e-9:
            roll, yaw = math.atan2(frame[2, 1], frame[2, 2]), math.atan2(frame[1, 0], frame[0, 0])
        else:  # the nose is up or down: roll and yaw turn about the same axis
            roll, yaw = math.atan2(-frame[1, 2], frame[1, 1]), 0.0
        return cls(xyz=text_of(frame[:3, 3]), rpy=text_of((roll, pitch, yaw)))


class Mass(_Element, tag="mass"):
    """Mass in kg; 0 for a link that is only a frame."""

    value: NotNegative = attr()


class Inertia(_Element, tag="inertia"):
    """The inertia matrix about the centre of mass, kg·m²: six entries, or all nine of them."""

    ixx: Finite = attr()
    ixy: Finite = attr(default=0.0)
    ixz: Finite = attr(default=0.0)
    iyy: Finite = attr()
    iyz: Finite = attr(default=0.0)
    izz: Finite = attr()
    iyx: Finite | None = attr(default=None)
    izx: Finite | None = attr(default=None)
    izy: Finite | None = attr(default=None)

    @model_validator(mode="after")
    def _symmetric(self) -> Self:
        rounding = 1e-6 * max(map(abs, (self.ixx, self.iyy, self.izz)))
        for upper, lower in (("ixy", "iyx"), ("ixz", "izx"), ("iyz", "izy")):
            above, below = getattr(self, upper), getattr(self, lower)
            if below is not None and abs(above - below) > rounding:
                raise ValueError(f"is not symmetric: {upper} is {above:g}, {lower} {below:g}")
        return self

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The matrix, shape (3, 3)."""
        xy, xz, yz = self.ixy, self.ixz, self.iyz
        return np.array([[self.ixx, xy, xz], [xy, self.iyy, yz], [xz, yz, self.izz]])


class Inertial(_Element, tag="inertial"):
    """Mass, the centre of mass, and the inertia about it."""

    origin: Origin = element(default_factory=Origin)
    mass: Mass = element()
    inertia: Inertia | None = element(default=None)


class Box(_Element, tag="box"):
    """Box, centred: extents along x, y, z, m."""

    size: Extents = attr()


class Cylinder(_Element, tag="cylinder"):
    """Cylinder along z, centred: radius and length, m."""

    radius: Positive = attr()
    length: Positive = attr()


class Sphere(_Element, tag="sphere"):
    """Sphere, centred: radius, m."""

    radius: Positive = attr()


class Mesh(_Element, tag="mesh"):
    """Mesh: its file, and by how much it is stretched along x, y, z."""

    filename: str = attr()
    scale: Scale = attr(default="1 1 1")


class Geometry(_Element, tag="geometry"):
    """Exactly one shape."""

    box: Box | None = element(default=None)
    cylinder: Cylinder | None = element(default=None)
    sphere: Sphere | None = element(default=None)
    mesh: Mesh | None = element(default=None)

    @property
    def shape(self) -> Box | Cylinder | Sphere | Mesh | None:
        """The shape, if there is exactly one."""
        shapes = (self.box, self.cylinder, self.sphere, self.mesh)
        given_shapes = [shape for shape in shapes if shape is not None]
        return given_shapes[0] if len(given_shapes) == 1 else None


class Collision(_Element, tag="collision"):
    """A shape that touches the ground."""

    name: str | None = attr(default=None)
    origin: Origin = element(default_factory=Origin)
    geometry: Geometry = element()

    def bounds(self, link: Frame) -> tuple[Points, Points]:
        """Least and greatest coordinates of a box, cylinder or sphere, m.

        Args:
            link: Pose of the link that has the shape.
        """
        frame, shape = link @ self.origin.frame, self.geometry.shape
        match shape:
            case Box():
                reach = np.abs(frame[:3, :3]) @ np.array(vector(shape.size)) / 2
            case Cylinder():
                along = np.minimum(np.abs(frame[:3, 2]), 1.0)
                reach = along * shape.length / 2 + np.sqrt(1 - along**2) * shape.radius
            case Sphere():
                reach = np.full(3, shape.radius)
            case _:
                reach = np.zeros(3)
        return frame[:3, 3] - reach, frame[:3, 3] + reach


class Visual(Collision, tag="visual"):
    """What is drawn of a link."""


class Link(_Element, tag="link"):
    """A rigid part."""

    name: str = attr()
    inertial: Inertial | None = element(default=None)
    collisions: list[Collision] = element(tag="collision", default_factory=list)
    visuals: list[Visual] = element(tag="visual", default_factory=list)

    @property
    def mass(self) -> float:
        """Mass of the link, kg; 0 without any."""
        return 0.0 if self.inertial is None else self.inertial.mass.value


class LinkName(_Element):
    """Name of a link."""

    link: str = attr()


class Axis(_Element, tag="axis"):
    """The axis of a joint, in its own frame."""

    xyz: Vector = attr(default="1 0 0")


class Limit(_Element, tag="limit"):
    """Limits of a joint: range in rad, effort in N·m, velocity in rad/s."""

    lower: Finite = attr(default=0.0)
    upper: Finite = attr(default=0.0)
    effort: NotNegative = attr(default=0.0)
    velocity: NotNegative = attr(default=0.0)


class Dynamics(_Element, tag="dynamics"):
    """Passive friction of a joint; a servo overcomes it."""

    damping: Finite = attr(default=0.0)
    friction: Finite = attr(default=0.0)


class Mimic(_Element, tag="mimic"):
    """The joint that a joint follows."""

    joint: str = attr()
    multiplier: Finite = attr(default=1.0)
    offset: Finite = attr(default=0.0)


class Joint(_Element, tag="joint"):
    """Joins a child link to its parent."""

    name: str = attr()
    type: Literal["fixed", "revolute", "continuous", "prismatic", "floating", "planar"] = attr()
    parent: LinkName = element()
    child: LinkName = element()
    origin: Origin = element(default_factory=Origin)
    axis: Axis = element(default_factory=Axis)
    limit: Limit | None = element(default=None)
    dynamics: Dynamics | None = element(default=None)
    mimic: Mimic | None = element(default=None)


class Robot(_Element, tag="robot"):
    """A whole URDF file."""

    name: str = attr()
    version: str | None = attr(default=None)
    links: list[Link] = element(tag="link", default_factory=list)
    joints: list[Joint] = element(tag="joint", default_factory=list)

    @property
    def roots(self) -> list[Link]:
        """The links that are no joint's child; of a body without faults one, its main body."""
        children = {joint.child.link for joint in self.joints}
        return [link for link in self.links if link.name not in children]
