"""The part of URDF that a scorer needs: links with simple shapes, fixed and revolute joints.

What of URDF does not shape a body (visuals, materials, limits, inertia) is skipped; any other word
is refused, for it may shape one: ``<colision>``, xacro, a mesh. Masses are not needed, but a mass
of 0 is no body's and is refused.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np
from lxml import etree
from pydantic import AfterValidator, Field, ValidationError
from pydantic_xml import BaseXmlModel, ParsingError, attr, element

from estimator.body.morphology import Array, rotation
from estimator.errors import TruthError


def numbers(text: str) -> tuple[float, float, float]:
    """The three numbers of an attribute such as ``xyz``."""
    x, y, z = (float(word) for word in text.split())
    return (x, y, z)


def _finite(text: str) -> str:
    with suppress(ValueError):
        if all(math.isfinite(value) for value in numbers(text)):
            return text
    raise ValueError("must be three finite numbers")


def _extents(text: str) -> str:
    if min(numbers(_finite(text))) <= 0:
        raise ValueError("must be three numbers above 0")
    return text


_Positive: TypeAlias = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Vector: TypeAlias = Annotated[str, AfterValidator(_finite)]  # pydantic-xml: no arrays in attributes
Extents: TypeAlias = Annotated[str, AfterValidator(_extents)]

LARGEST: Final = 4 * 2**20
"""Largest size of a file, bytes; the descriptions of whole humanoids have a tenth of that."""

MAX_ELEMENTS: Final = 20_000
"""Largest number of XML elements in a file."""

_ZERO: Final = "0 0 0"
_SKIPPED: Final = frozenset(
    (
        *("visual", "material", "gazebo", "transmission", "inertia"),
        *("limit", "dynamics", "calibration", "safety_controller"),
    )
)
_EXPRESSION: Final = re.compile(r"\$[{(]")
_PRINTED: Final = "give what sim-robotd --body FILE --print-body makes of it"


class _Element(BaseXmlModel, search_mode="unordered", extra="forbid"):
    """An XML element; its children may come in any order, and unknown ones are refused."""


class Origin(_Element, tag="origin"):
    """A frame in its parent's frame: place, m, and fixed-axis roll, pitch and yaw, rad."""

    xyz: Vector = attr(default=_ZERO)
    rpy: Vector = attr(default=_ZERO)

    @property
    def frame(self) -> tuple[Array, Array]:
        """Rotation, shape (3, 3), and place, m, shape (3,)."""
        roll, pitch, yaw = numbers(self.rpy)
        turn = rotation((0.0, 0.0, 1.0), yaw) @ rotation((0.0, 1.0, 0.0), pitch)
        return turn @ rotation((1.0, 0.0, 0.0), roll), np.array(numbers(self.xyz))


class Box(_Element, tag="box"):
    """A box with its middle at the origin, m."""

    size: Extents = attr()


class Cylinder(_Element, tag="cylinder"):
    """A cylinder about z with its middle at the origin, m."""

    radius: _Positive = attr()
    length: _Positive = attr()


class Sphere(_Element, tag="sphere"):
    """A sphere about the origin, m."""

    radius: _Positive = attr()


class Geometry(_Element, tag="geometry"):
    """One shape."""

    box: Box | None = element(default=None)
    cylinder: Cylinder | None = element(default=None)
    sphere: Sphere | None = element(default=None)

    @property
    def shape(self) -> Box | Cylinder | Sphere | None:
        """The shape, or ``None`` where there is not exactly one."""
        shapes = [shape for shape in (self.box, self.cylinder, self.sphere) if shape is not None]
        return shapes[0] if len(shapes) == 1 else None


class Collision(_Element, tag="collision"):
    """A shape in its link's frame."""

    name: str | None = attr(default=None)
    origin: Origin = element(default=Origin())
    geometry: Geometry = element()


class Mass(_Element, tag="mass"):
    """A mass, kg."""

    value: _Positive = attr()


class Inertial(_Element, tag="inertial"):
    """The mass of a link."""

    origin: Origin = element(default=Origin())
    mass: Mass = element()


class Link(_Element, tag="link"):
    """A rigid body."""

    name: str = attr(min_length=1)
    inertial: Inertial | None = element(default=None)
    collisions: list[Collision] = element(tag="collision", default=[])


class Neighbour(_Element):
    """The parent or child link that a joint names."""

    link: str = attr()


class Axis(_Element, tag="axis"):
    """A joint's axis in the child's frame."""

    xyz: Vector = attr(default="1 0 0")


class Joint(_Element, tag="joint"):
    """Holds a child link in its parent's frame; a revolute one turns it about ``axis``."""

    name: str = attr(min_length=1)
    type: Literal["fixed", "revolute"] = attr()
    parent: Neighbour = element(tag="parent")
    child: Neighbour = element(tag="child")
    origin: Origin = element(default=Origin())
    axis: Axis = element(default=Axis())


class Urdf(_Element, tag="robot"):
    """A robot: links and the joints between them, in document order."""

    name: str = attr(default="robot")
    version: str | None = attr(default=None)
    links: list[Link] = element(tag="link")
    joints: list[Joint] = element(tag="joint", default=[])

    @property
    def root(self) -> str:
        """Name of the link that is nobody's child."""
        children = {joint.child.link for joint in self.joints}
        return next(link.name for link in self.links if link.name not in children)

    @property
    def main_body(self) -> tuple[tuple[float, float, float], tuple[float, float, float], bool]:
        """Extents of the root's shape, m, its middle in the root's frame, and whether it is round.

        A round one is an upright cylinder, any other a box.
        """
        (collision,) = next(link for link in self.links if link.name == self.root).collisions
        shape, middle = collision.geometry.shape, numbers(collision.origin.xyz)
        if isinstance(shape, Cylinder):
            return (2 * shape.radius, 2 * shape.radius, shape.length), middle, True
        assert isinstance(shape, Box)
        return numbers(shape.size), middle, False


def read_urdf(path: Path) -> Urdf:
    """Reads a URDF file.

    Raises:
        TruthError: The file cannot be read, is too large, is no URDF of the supported subset, or
            its links form no tree; the message names file, element and reason.
    """
    try:
        with path.open("rb") as file:
            root = _grouped(file.read(LARGEST + 1))
    except OSError as error:
        raise TruthError(f"{path} cannot be read: {error.strerror}.") from error
    except SyntaxError as error:  # what lxml raises derives from it
        raise TruthError(f"{path} is no XML file: {error}.") from error
    except ValueError as error:
        raise TruthError(f"{path} {error}.") from error
    if _is_xacro(root):
        raise TruthError(f"{path} is xacro, of which URDF is made first: xacro FILE > robot.urdf.")
    try:
        urdf = Urdf.from_xml_tree(root)  # type: ignore[arg-type]
    except ValidationError as error:
        first = error.errors()[0]
        reason = re.sub(r"^\[line -?\d+\]: ", "", first["msg"]).removeprefix("Value error, ")
        reason = reason.replace("Extra inputs are not permitted", f"is unknown here: {_PRINTED}")
        raise TruthError(f"{path}: {_where(root, first['loc'])}: {reason}.") from error
    except ParsingError as error:
        raise TruthError(f"{path} is no URDF file: {error}.") from error
    _check_tree(path, urdf)
    return urdf


def _grouped(text: bytes) -> etree._Element:
    """Parses a file, drops what is skipped and groups elements by kind, as the validator needs.

    The validator searches for elements by exchanging them with those that stand in their place, so
    joints between links, or collisions before a mass, would come out of document order.
    """
    if len(text) > LARGEST:
        raise ValueError(f"has more than {LARGEST / 2**20:g} MiB, as no robot's has")
    parser = etree.XMLParser(remove_comments=True, remove_pis=True, resolve_entities=False)
    root = etree.fromstring(text, parser)
    if root.getroottree().docinfo.internalDTD is not None:
        raise SyntaxError("a DOCTYPE is no part of URDF; leave it and its entities out")
    elements = list(root.iter())
    if len(elements) > MAX_ELEMENTS:
        raise ValueError(f"has more than {MAX_ELEMENTS} elements, as no robot's has")
    for parent in elements:
        parent[:] = sorted(
            (child for child in parent if child.tag not in _SKIPPED),
            key=lambda child: child.tag in ("joint", "collision"),
        )
    return root


def _is_xacro(root: etree._Element) -> bool:
    """Whether macros or expressions are left in what is read."""
    return any(
        "xacro}" in str(element.tag)
        or any(_EXPRESSION.search(str(value)) for value in element.attrib.values())
        for element in root.iter()
    )


def _where(root: etree._Element, place: tuple[int | str, ...]) -> str:
    """Place of a validation error, by the names that stand in the file."""
    names = []
    if len(place) > 1 and place[0] in ("links", "joints") and isinstance(place[1], int):
        tag = str(place[0])[:-1]
        name = root.findall(tag)[place[1]].get("name")
        names.append(f"{tag} {name or f'number {place[1] + 1}'}")
        place = place[2:]
    inner = ".".join(str(step) for step in place if isinstance(step, str))
    return ": ".join([*names, *([inner] if inner else [])]) or "robot"


def _check_tree(path: Path, urdf: Urdf) -> None:
    links = Counter(link.name for link in urdf.links)
    for name, count in links.items():
        if count > 1:
            raise TruthError(f"{path}: two links are named {name}.")
    children = {joint.child.link for joint in urdf.joints}
    main = next((link for link in urdf.links if link.name not in children), None)
    if main is None:
        raise TruthError(f"{path}: every link is some joint's child, so there is no main body.")
    reached = {main.name}
    for joint in urdf.joints:
        if joint.parent.link not in reached:
            raise TruthError(
                f"{path}: joint {joint.name}: its parent {joint.parent.link} is unknown here; "
                "list a joint after the one that holds its parent."
            )
        if joint.child.link not in links or joint.child.link in reached:
            raise TruthError(
                f"{path}: joint {joint.name}: its child {joint.child.link} must be a link that "
                "no other joint holds."
            )
        if math.hypot(*numbers(joint.axis.xyz)) == 0:
            raise TruthError(f"{path}: joint {joint.name}: its axis has no direction.")
        reached.add(joint.child.link)
    loose = [name for name in links if name not in reached]
    if loose:
        raise TruthError(f"{path}: no joint holds {', '.join(loose)}.")
    for link in urdf.links:
        if any(collision.geometry.shape is None for collision in link.collisions):
            raise TruthError(
                f"{path}: link {link.name}: a geometry must be one box, cylinder or sphere."
            )
    straight = [
        one for one in main.collisions if not (one.geometry.sphere or any(numbers(one.origin.rpy)))
    ]
    if not len(straight) == len(main.collisions) == 1:
        raise TruthError(
            f"{path}: link {main.name}: the main body must be one box or cylinder, not turned: "
            f"{_PRINTED}."
        )
