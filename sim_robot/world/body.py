"""A simulated body: a URDF file of the subset, checked, with the names that a robot needs.

Motor k is the k-th revolute joint in document order. The root link is the main body; it carries the
accelerometer and, at the middle of its lower face, the distance sensor. Touch sensors sit on the
leaf links, in the order of their motors; a sensor feels its link and whatever is fixed to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from protocol.wire.field_checks import MAX_NAME
from sim_robot.errors import BodyError
from sim_robot.world.urdf import Box, Cylinder, Joint, Limit, Link, Robot, Sphere, read_urdf, vector

MAX_MOTORS = 8  # outputs of the servo board
MAX_LINKS = 100  # PyBullet loads no body of 127


DEFAULT = "quadruped"


def default_body_path() -> Path:
    """The quadruped of the paper's Table 1."""
    return shipped_bodies()[DEFAULT]


def shipped_bodies() -> dict[str, Path]:
    """The bodies that come with the simulator, by name."""
    folder = Path(str(resources.files("sim_robot") / "bodies"))
    return {path.stem: path for path in sorted(folder.glob("*.urdf"))}


def body_path(name_or_file: str) -> Path:
    """The file of a body.

    Args:
        name_or_file: The name of a body that comes with the simulator, or a URDF file.

    Raises:
        BodyError: It is neither.
    """
    shipped = shipped_bodies()
    if name_or_file in shipped:
        return shipped[name_or_file]
    path = Path(name_or_file)
    if path.suffix != ".urdf" and not path.exists():
        raise BodyError(
            name_or_file, "", f"is neither a URDF file nor one of {', '.join(shipped)}."
        )
    return path


@dataclass(frozen=True, kw_only=True)
class Motor:
    """A driven joint: limits in rad, torque in N·m, and the radius of the part it moves, m."""

    name: str
    link: str
    lower: float
    upper: float
    effort: float
    radius: float


@dataclass(frozen=True, kw_only=True)
class Body:
    """A checked body.

    Attributes:
        name: The robot's name.
        urdf: The file as PyBullet gets it.
        base: Name of the root link.
        base_size: Its box, m.
        base_center: The middle of that box in the root link's frame, m.
        base_mass: Its mass, kg.
        mass: Of all links together, kg.
        motors: In document order.
        touch: For each touch sensor its link and the links that are fixed to it.
    """

    name: str
    urdf: str
    base: str
    base_size: tuple[float, float, float]
    base_center: tuple[float, float, float]
    base_mass: float
    mass: float
    motors: tuple[Motor, ...]
    touch: dict[str, frozenset[str]]


def load_body(path: Path) -> Body:
    """Reads and checks a body.

    Raises:
        BodyError: Names file, element and reason.
    """
    robot = read_urdf(path)
    return _Checker(str(path), robot).body()


class _Checker:
    """Checks what a schema cannot: the tree, the order, what belongs to what."""

    def __init__(self, file: str, robot: Robot):
        self._file = file
        self._robot = robot
        self._links = {link.name: link for link in robot.links}

    def body(self) -> Body:
        self._check_names()
        root = self._check_tree()
        self._check_links(root)
        box, center = self._base_box(root)
        moving = [joint for joint in self._robot.joints if joint.type == "revolute"]
        if not 1 <= len(moving) <= MAX_MOTORS:
            raise self._refuse(
                "robot", f"must have 1 to {MAX_MOTORS} revolute joints, not {len(moving)}."
            )
        return Body(
            name=self._robot.name,
            urdf=str(self._robot.to_xml(encoding="unicode", skip_empty=True)),
            base=root.name,
            base_size=vector(box.size),
            base_center=center,
            base_mass=root.inertial.mass.value if root.inertial else 0.0,
            mass=sum(link.inertial.mass.value for link in self._robot.links if link.inertial),
            motors=tuple(self._motor(joint) for joint in moving),
            touch=self._touch(root.name, moving),
        )

    def _refuse(self, element: str, reason: str) -> BodyError:
        return BodyError(self._file, element, reason)

    def _check_names(self) -> None:
        if not 1 <= len(self._robot.name) <= MAX_NAME:
            raise self._refuse("robot: name", f"names have 1 to {MAX_NAME} characters.")
        size = max(len(self._robot.links), len(self._robot.joints))
        if size > MAX_LINKS:
            raise self._refuse("robot", f"must have at most {MAX_LINKS} links, not {size}.")
        for kind, names in (
            ("link", [link.name for link in self._robot.links]),
            ("joint", [joint.name for joint in self._robot.joints]),
        ):
            for name in names:
                if names.count(name) > 1:
                    raise self._refuse(f"{kind} '{name}'", f"two {kind}s share this name.")
                if not 1 <= len(name) <= MAX_NAME:
                    raise self._refuse(
                        f"{kind} '{name:.70}'", f"names have 1 to {MAX_NAME} characters."
                    )

    def _check_tree(self) -> Link:
        placed: set[str] = set()
        for joint in self._robot.joints:
            for role, name in (("parent", joint.parent.link), ("child", joint.child.link)):
                if name not in self._links:
                    raise self._refuse(
                        f"joint '{joint.name}'", f"its {role} '{name}' is not a link of this file."
                    )
        children = [joint.child.link for joint in self._robot.joints]
        roots = [link for link in self._robot.links if link.name not in children]
        if len(roots) != 1:
            names = ", ".join(link.name for link in roots) or "none"
            raise self._refuse(
                "robot", f"must have exactly one link that is no joint's child; found: {names}."
            )
        placed.add(roots[0].name)
        for joint in self._robot.joints:
            where = f"joint '{joint.name}'"
            if joint.child.link in placed:
                raise self._refuse(
                    where, f"its child '{joint.child.link}' already hangs on another joint."
                )
            if joint.parent.link not in placed:
                raise self._refuse(
                    where,
                    f"comes before the joint that attaches its parent '{joint.parent.link}', or "
                    "the joints form a ring; list parents first.",
                )
            placed.add(joint.child.link)
        return roots[0]

    def _check_links(self, root: Link) -> None:
        for link in self._robot.links:
            where = f"link '{link.name}'"
            if link.inertial is None:
                raise self._refuse(where, "needs <inertial> with a mass above 0.")
            for collision in link.collisions:
                if collision.geometry.shape is None:
                    raise self._refuse(
                        f"{where}: collision: geometry",
                        "must hold exactly one box, cylinder or sphere.",
                    )
        if len(root.collisions) != 1 or not isinstance(root.collisions[0].geometry.shape, Box):
            raise self._refuse(
                f"link '{root.name}'", "the root link must have exactly one collision, a box."
            )

    def _base_box(self, root: Link) -> tuple[Box, tuple[float, float, float]]:
        collision = root.collisions[0]
        box = collision.geometry.shape
        assert isinstance(box, Box)
        if any(vector(collision.origin.rpy)):
            raise self._refuse(
                f"link '{root.name}': collision: origin", "the root link's box must not be turned."
            )
        return box, vector(collision.origin.xyz)

    def _motor(self, joint: Joint) -> Motor:
        limit = joint.limit
        where = f"joint '{joint.name}'"
        if limit is None:
            raise self._refuse(where, "a revolute joint needs <limit>.")
        self._check_limit(where, limit)
        if not any(vector(joint.axis.xyz)):
            raise self._refuse(f"{where}: axis", "must not be 0 0 0.")
        return Motor(
            name=joint.name,
            link=joint.child.link,
            lower=limit.lower,
            upper=limit.upper,
            effort=limit.effort,
            radius=self._radius(joint.child.link),
        )

    def _check_limit(self, where: str, limit: Limit) -> None:
        if not -3.15 <= limit.lower < 0 < limit.upper <= 3.15:
            raise self._refuse(
                f"{where}: limit",
                f"must span 0 within ±π rad, not {limit.lower:g} to {limit.upper:g}.",
            )

    def _radius(self, name: str) -> float:
        """Radius of the first shape on a link or on what is fixed to it; 6 mm without any."""
        for link in sorted(self._group(name), key=lambda item: item != name):
            for collision in self._links[link].collisions:
                shape = collision.geometry.shape
                if isinstance(shape, Cylinder | Sphere):
                    return shape.radius
                if isinstance(shape, Box):
                    return min(vector(shape.size)) / 2
        return 0.006

    def _group(self, name: str) -> frozenset[str]:
        links = {name}
        for joint in self._robot.joints:  # parents come first, so one pass is enough
            if joint.type == "fixed" and joint.parent.link in links:
                links.add(joint.child.link)
        return frozenset(links)

    def _touch(self, root: str, moving: list[Joint]) -> dict[str, frozenset[str]]:
        groups = {joint.child.link: self._group(joint.child.link) for joint in moving}
        carried = set(self._parents(moving))
        return {
            name: group
            for name, group in groups.items()
            if name != root and not group & carried and self._has_shape(group)
        }

    @staticmethod
    def _parents(moving: list[Joint]) -> Iterator[str]:
        for joint in moving:
            yield joint.parent.link

    def _has_shape(self, group: frozenset[str]) -> bool:
        return any(self._links[name].collisions for name in group)
