"""A simulated body: a URDF file of the subset, checked, with the names that a robot needs.

As it is read, motor k is the k-th revolute joint in document order. The root link is the main body;
it carries the accelerometer and, at the middle of its lower face, the distance sensor. Touch
sensors sit on the leaf links, in the order of their motors; a sensor senses its link and whatever
is fixed to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Final

import numpy as np

from protocol.system.files import may_exist
from protocol.text import command_line
from sim_robot.errors import BodyError
from sim_robot.world.urdf.declarations import Box, Cylinder, Joint, Robot, Sphere, vector
from sim_robot.world.urdf.reading import read_urdf

DEFAULT: Final = "quadruped"
_FLATNESS: Final = 1e-3  # m that a part may reach below the belly of a body that lies flat


def default_body_path() -> Path:
    """File of the quadruped of the paper's Table 1."""
    return shipped_bodies()[DEFAULT]


def shipped_bodies() -> dict[str, Path]:
    """Files of the bodies that come with the simulator, by name."""
    folder = Path(str(resources.files("sim_robot") / "bodies"))
    return {path.stem: path for path in sorted(folder.glob("*.urdf"))}


def body_path(name_or_file: str) -> Path:
    """The file of a body.

    Args:
        name_or_file: The name of a body that comes with the simulator, or a URDF file.

    Raises:
        BodyError: The text is neither.
    """
    shipped = shipped_bodies()
    if name_or_file in shipped:
        return shipped[name_or_file]
    path = Path(name_or_file)
    if path.suffix != ".urdf" and not may_exist(path):
        raise BodyError(
            name_or_file, "", f"is neither a URDF file nor one of {', '.join(shipped)}."
        )
    return path


@dataclass(frozen=True, kw_only=True)
class Motor:
    """A driven joint: limits in rad, effort in N·m, and the radius, if any, of what it moves, m."""

    name: str
    link: str
    lower: float
    upper: float
    effort: float
    radius: float | None


@dataclass(frozen=True, kw_only=True)
class Body:
    """A checked body.

    Attributes:
        name: The robot's name.
        robot: Links and joints of the robot.
        base: Name of the root link, which is the main body.
        base_size: Extents of the main body, m.
        base_radius: Radius of a main body that is an upright cylinder, m; ``None``: it is a box.
        base_center: Middle of the main body in the root link's frame, m.
        base_mass: Mass of the main body, kg.
        lies_flat: Whether the main body lies on the ground with all joints at 0.
        mass: Mass of all links together, kg.
        motors: Motors in the robot's order.
        touch: Link of each touch sensor with the links that are fixed to it, by the sensor's name.
        notes: What is taken otherwise than it stands in the file, in one sentence each.
    """

    name: str
    robot: Robot
    base: str
    base_size: tuple[float, float, float]
    base_radius: float | None
    base_center: tuple[float, float, float]
    base_mass: float
    lies_flat: bool
    mass: float
    motors: tuple[Motor, ...]
    touch: dict[str, frozenset[str]]
    notes: tuple[str, ...] = ()

    @property
    def urdf(self) -> str:
        """The description as an engine that reads URDF gets it."""
        # PyBullet breaks a line of more than 8 KiB, be it in the middle of a word.
        return str(self.robot.to_xml(encoding="unicode", skip_empty=True)).replace("><", ">\n<")


def load_body(path: Path) -> Body:
    """Reads and checks a body.

    Raises:
        BodyError: The body has faults; names file, element and reason of the first, counts others.
    """
    body, faults = examine(path)
    if body is None:
        if len(faults) > 1:
            check = command_line("sim-robotd", "--check", path)
            first, hint = faults[0], f" ({len(faults) - 1} more: {check})"
            raise BodyError(first.file, first.element, first.reason + hint)
        raise faults[0]
    return body


def examine(path: Path) -> tuple[Body | None, tuple[BodyError, ...]]:
    """Reads a body; returns it, or ``None`` and all that is wrong with it."""
    try:
        description = read_urdf(path)
    except BodyError as error:
        return None, (error,)
    if description.faults:
        return None, description.faults
    return _body(description.robot, description.notes), ()


def _body(robot: Robot, notes: tuple[str, ...]) -> Body:
    (root,) = robot.roots
    (collision,) = root.collisions
    shape, center = collision.geometry.shape, vector(collision.origin.xyz)
    if isinstance(shape, Cylinder):
        radius, size = shape.radius, (2 * shape.radius, 2 * shape.radius, shape.length)
    else:
        assert isinstance(shape, Box)
        radius, size = None, vector(shape.size)
    moving = [joint for joint in robot.joints if joint.type == "revolute"]
    return Body(
        name=robot.name,
        robot=robot,
        base=root.name,
        base_size=size,
        base_radius=radius,
        base_center=center,
        base_mass=root.mass,
        lies_flat=_lowest(robot, root.name) > center[2] - size[2] / 2 - _FLATNESS,
        mass=sum(link.mass for link in robot.links),
        motors=tuple(_motor(joint, robot) for joint in moving),
        touch=_touch(robot, moving),
        notes=notes,
    )


def _lowest(robot: Robot, root: str) -> float:
    """The lowest point of all parts with all joints at 0, in the root link's frame, m."""
    frames = {root: np.eye(4)}
    for joint in robot.joints:  # parents come first
        frames[joint.child.link] = frames[joint.parent.link] @ joint.origin.frame
    return min(
        float(collision.bounds(frames[link.name])[0][2])
        for link in robot.links
        for collision in link.collisions
    )


def _motor(joint: Joint, robot: Robot) -> Motor:
    limit = joint.limit
    assert limit is not None
    return Motor(
        name=joint.name,
        link=joint.child.link,
        lower=limit.lower,
        upper=limit.upper,
        effort=limit.effort,
        radius=_radius(joint.child.link, robot),
    )


def _radius(name: str, robot: Robot) -> float | None:
    """Radius of the first shape on a link or on what is fixed to it; ``None`` without any."""
    links = {link.name: link for link in robot.links}
    for link in sorted(_group(name, robot), key=lambda item: item != name):
        for collision in links[link].collisions:
            shape = collision.geometry.shape
            if isinstance(shape, Cylinder | Sphere):
                return shape.radius
            if isinstance(shape, Box):
                return min(vector(shape.size)) / 2
    return None


def _group(name: str, robot: Robot) -> frozenset[str]:
    """A link and all that is fixed to it."""
    links = {name}
    for joint in robot.joints:  # parents come first, so one pass is enough
        if joint.type == "fixed" and joint.parent.link in links:
            links.add(joint.child.link)
    return frozenset(links)


def _touch(robot: Robot, moving: list[Joint]) -> dict[str, frozenset[str]]:
    """Links that carry nothing that moves and can touch the ground, each with its group."""
    shaped = {link.name for link in robot.links if link.collisions}
    carriers = {joint.parent.link for joint in moving}
    groups = {joint.child.link: _group(joint.child.link, robot) for joint in moving}
    return {
        name: group for name, group in groups.items() if not group & carriers and group & shaped
    }
