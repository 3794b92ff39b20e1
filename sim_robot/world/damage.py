"""What can happen to a body while it runs: legs that break, bend, grow or carry a weight.

The body is described anew and the world built of it; joints and touch sensors keep their names, so
the robot's daemon knows nothing of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sim_robot.world.body import Body
from sim_robot.world.urdf.declarations import (
    Axis,
    Box,
    Collision,
    Cylinder,
    Frame,
    Inertia,
    Inertial,
    Joint,
    Link,
    Mass,
    Origin,
    Points,
    Robot,
    frame_of,
    rotation,
    text_of,
    vector,
)

_STUMP: Final = Inertial(
    mass=Mass(value=1e-3), inertia=Inertia(ixx=1e-7, iyy=1e-7, izz=1e-7)
)  # what is left of a link that broke off: an engine needs a mass
_ALIGNED: Final = 0.99  # cosine to a leg's direction of what is stretched or cut with it


def damaged(body: Body, fault: str, number: int, amount: float) -> Body:
    """A body with one damage.

    Args:
        body: The body; it stays as it is.
        fault: A key of ``Damage.FAULTS``.
        number: Number of the leg's motor, from 1.
        amount: Amount of damage, in the unit of the fault.
    """
    robot: Robot = body.robot.model_copy(deep=True)
    leg = _Leg.of(robot, body.motors[number - 1].name)
    match fault:
        case "cut":
            leg.cut(amount / 100)
        case "length":
            leg.stretch(amount / 100)
        case "bent":
            leg.bend(math.radians(amount))
        case "twisted":
            axis = rotation(leg.direction, math.radians(amount)) @ vector(leg.joint.axis.xyz)
            leg.joint.axis = Axis(xyz=text_of(axis))
        case "aside":
            frame = leg.joint.origin.frame
            frame[:3, :3] = rotation((0.0, 0.0, 1.0), math.radians(amount)) @ frame[:3, :3]
            leg.joint.origin = Origin.at(frame)
        case "weight":
            leg.load(amount / 1000)
    return replace(body, robot=robot, mass=sum(link.mass for link in robot.links))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Leg:
    """All that hangs from a joint, with joints at 0, in the frame of the first link.

    Attributes:
        joint: Joint from which the leg hangs.
        links: Links by name, parents first.
        joints: Joints between these links.
        frames: Frames of the links, by name.
        direction: Unit vector towards the far end of the leg.
        length: Length to the far end, m.
        farthest: Name of the link that reaches to the far end.
    """

    joint: Joint
    links: dict[str, Link]
    joints: list[Joint]
    frames: dict[str, Frame]
    direction: Points
    length: float
    farthest: str

    @classmethod
    def of(cls, robot: Robot, name: str) -> _Leg:
        """The leg of a joint."""
        (joint,) = (joint for joint in robot.joints if joint.name == name)
        frames, joints = {joint.child.link: np.eye(4)}, []
        for one in robot.joints:  # parents come first
            if one.parent.link in frames:
                frames[one.child.link] = frames[one.parent.link] @ one.origin.frame
                joints.append(one)
        links = {link.name: link for link in robot.links if link.name in frames}
        ends = [
            (float(np.linalg.norm(end)), link, end)
            for link in links
            for shape in links[link].collisions
            for end in _ends(frames[link] @ shape.origin.frame, shape)
        ]
        length, farthest, end = max(ends, key=lambda one: one[0])
        direction = end / length
        reach = max(
            _extent(frames[link], one, direction)[1]
            for link in links
            for one in links[link].collisions
        )
        return cls(
            joint=joint,
            links=links,
            joints=joints,
            frames=frames,
            direction=direction,
            length=reach,
            farthest=farthest,
        )

    def stretch(self, factor: float) -> None:
        """Makes the leg ``factor`` times as long; it stays as thick."""
        for name, link in self.links.items():
            along = self._along(name)
            for shape in link.collisions:
                _resize(shape, along, factor)
                shape.origin = _moved(shape.origin, along, factor - 1)
            if link.inertial is not None:
                origin = _moved(link.inertial.origin, along, factor - 1)
                link.inertial = _scaled(link.inertial, origin, factor)
        for joint in self.joints:
            joint.origin = _moved(joint.origin, self._along(joint.parent.link), factor - 1)

    def cut(self, left: float) -> None:
        """Takes away what is farther out than the share ``left`` of the length."""
        place = left * self.length
        for name, link in self.links.items():
            along, kept, volume, old_volume = self._along(name), list[Collision](), 0.0, 0.0
            for shape in link.collisions:
                low, high = _extent(self.frames[name], shape, self.direction)
                old_volume += high - low
                if high > place:
                    share = (place - low) / (high - low)
                    if share <= 0 or not _resize(shape, along, share):
                        continue
                    shape.origin = _shifted(shape.origin, -along * (high - place) / 2)
                    volume += place - low
                else:
                    volume += high - low
                kept.append(shape)
            if link.inertial is not None and volume < old_volume:
                share = volume / old_volume
                origin = _moved(link.inertial.origin, along, share - 1)
                stump = _STUMP.model_copy(deep=True)
                link.inertial = _scaled(link.inertial, origin, share) if share > 0 else stump
            link.collisions = kept

    def bend(self, angle: float) -> None:
        """Bends the leg at half its length by an angle, rad, about its hinge's axis if possible."""
        axis = np.array(vector(self.joint.axis.xyz))
        if abs(axis @ self.direction) > _ALIGNED:
            axis = np.cross(self.direction, np.eye(3)[np.argmin(np.abs(self.direction))])
        place = self.length / 2
        turned_middle = frame_of(place * self.direction)
        turned_middle[:3, :3] = rotation(axis, angle)
        bend = turned_middle @ frame_of(-place * self.direction)
        turned_links = set[str]()  # links that are turned with what carries them
        for joint in self.joints:
            frame = self.frames[joint.parent.link]
            if joint.parent.link in turned_links:
                turned_links.add(joint.child.link)
            elif self.frames[joint.child.link][:3, 3] @ self.direction > place - 1e-9:
                joint.origin = Origin.at(np.linalg.inv(frame) @ bend @ frame @ joint.origin.frame)
                turned_links.add(joint.child.link)
        for name, link in self.links.items():
            if name not in turned_links:
                self._bend_link(name, link, place, bend)

    def _bend_link(self, name: str, link: Link, place: float, bend: Frame) -> None:
        frame, along = self.frames[name], self._along(name)
        local_bend = np.linalg.inv(frame) @ bend @ frame
        bent_shapes = list[Collision]()
        for shape in link.collisions:
            low, high = _extent(frame, shape, self.direction)
            share = (place - low) / (high - low)
            outer = shape.model_copy(deep=True)
            if share >= 1:
                bent_shapes.append(shape)
                continue
            if share > 0 and _resize(shape, along, share):
                _resize(outer, along, 1 - share)
                for part, shift in ((shape, -(high - place) / 2), (outer, (place - low) / 2)):
                    part.origin = _shifted(part.origin, shift * along)
                bent_shapes.append(shape)
            outer.origin = Origin.at(local_bend @ outer.origin.frame)
            bent_shapes.append(outer)
        link.collisions = bent_shapes

    def load(self, mass: float) -> None:
        """Hangs a weight, kg, at the far end."""
        link = self.links[self.farthest]
        inertial = link.inertial
        assert inertial is not None
        assert inertial.inertia is not None
        tip = np.append(self.length * self.direction, 1.0)
        frame = inertial.origin.frame
        offset = (np.linalg.inv(self.frames[self.farthest] @ frame) @ tip)[:3]
        old_mass, new_mass = inertial.mass.value, inertial.mass.value + mass
        tensor = inertial.inertia.matrix + old_mass * mass / new_mass * (
            (offset @ offset) * np.eye(3) - np.outer(offset, offset)
        )
        frame[:3, 3] += frame[:3, :3] @ offset * mass / new_mass
        link.inertial = Inertial(
            origin=Origin(xyz=text_of(frame[:3, 3]), rpy=inertial.origin.rpy),
            mass=Mass(value=new_mass),
            inertia=_inertia(tensor),
        )

    def _along(self, link: str) -> Points:
        """The leg's direction in a link's frame."""
        along: Points = self.frames[link][:3, :3].T @ self.direction
        return along


def _ends(frame: Frame, shape: Collision) -> list[Points]:
    """The middles of a box's faces, the ends of a cylinder's axis, the middle of a sphere."""
    solid, middle = shape.geometry.shape, frame[:3, 3]
    if isinstance(solid, Box):
        halves = np.array(vector(solid.size)) / 2 * frame[:3, :3]
        return [middle + sign * half for half in halves.T for sign in (-1, 1)]
    if isinstance(solid, Cylinder):
        return [middle + sign * solid.length / 2 * frame[:3, 2] for sign in (-1, 1)]
    return [middle]


def _extent(link: Frame, shape: Collision, direction: Points) -> tuple[float, float]:
    """Lowest and highest coordinate of a shape along a direction, m."""
    rows = np.eye(4)
    rows[0, :3] = direction
    side = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    rows[1, :3] = side / np.linalg.norm(side)
    rows[2, :3] = np.cross(rows[0, :3], rows[1, :3])
    low, high = shape.bounds(rows @ link)
    return float(low[0]), float(high[0])


def _resize(shape: Collision, along: Points, factor: float) -> bool:
    """Scales a shape along a direction of its link, if it has an axis there; returns whether."""
    solid, turn = shape.geometry.shape, shape.origin.frame[:3, :3]
    cosines = np.abs(turn.T @ along)
    if isinstance(solid, Cylinder) and cosines[2] > _ALIGNED:
        solid.length *= factor
        return True
    if isinstance(solid, Box) and cosines.max() > _ALIGNED:
        size = np.array(vector(solid.size))
        size[np.argmax(cosines)] *= factor
        solid.size = text_of(size)
        return True
    return False


def _moved(origin: Origin, along: Points, share: float) -> Origin:
    """An origin moved along a direction by a share of its distance in that direction."""
    return _shifted(origin, share * (np.array(vector(origin.xyz)) @ along) * along)


def _shifted(origin: Origin, shift: Points) -> Origin:
    return Origin(xyz=text_of(np.array(vector(origin.xyz)) + shift), rpy=origin.rpy)


def _scaled(inertial: Inertial, origin: Origin, factor: float) -> Inertial:
    """Mass and inertia of a link that is ``factor`` times as long."""
    assert inertial.inertia is not None
    mass = Mass(value=factor * inertial.mass.value)
    return Inertial(origin=origin, mass=mass, inertia=_inertia(factor**3 * inertial.inertia.matrix))


def _inertia(tensor: Points) -> Inertia:
    values = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2)}
    values["izz"] = (2, 2)
    return Inertia(**{name: float(tensor[place]) for name, place in values.items()})
