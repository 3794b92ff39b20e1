"""Bodies as links and joints, and as solids at rest in the world.

Nothing is simulated here. The angles say where the parts are on the body, the tilt says which way
is up, and whatever is lowest lies on the ground; only the heading stays open, and is chosen so that
the body's front points along x. So a robot is shown as its own sensors describe it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, PlainSerializer

from estimator.body.morphology import Array, Morphology, Part, rotation
from estimator.evaluation.truth.urdf import Box, Collision, Cylinder, Urdf, numbers
from estimator.readings.observation import Observation
from protocol.wire.readings import belly_ray, up_of

MAIN_BODY: Final = -1
"""Number of the limb of links and solids that belong to the main body."""

_DIGITS: Final = 7


def _rounded(values: Sequence[float]) -> list[float]:
    """Numbers rounded for a page, without negative zeros."""
    return [round(value, _DIGITS) + 0.0 for value in values]


Numbers: TypeAlias = Annotated[tuple[float, ...], PlainSerializer(_rounded)]
Kind: TypeAlias = Literal["box", "cylinder", "sphere"]

_STRAIGHT: Final = tuple(np.eye(3).ravel().tolist())


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True)


class Shape(_Record):
    """One shape of a link.

    Attributes:
        kind: ``box``, ``cylinder``, ``sphere`` or ``capsule``.
        size: Box: extents; cylinder (about z): radius, length; sphere: radius; capsule (along x):
            radius, distance of its centres; m.
        place: Position of its middle in the link's frame, m.
        turn: Rotation of the shape in the link's frame, nine numbers row by row.
    """

    kind: Kind | Literal["capsule"]
    size: Numbers
    place: Numbers = (0.0, 0.0, 0.0)
    turn: Numbers = _STRAIGHT


class Link(_Record):
    """What moves as one piece; link 0 is the main body.

    Attributes:
        name: Name for people.
        parent: Index of its parent, an earlier link; −1 for the main body.
        place: Position of its joint in the parent's frame, m.
        turn: Rotation of its frame in the parent's while its joint stands at 0, nine numbers row by
            row.
        axis: Axis of its joint, in its own frame.
        joint: Index of the robot's joint that turns it; −1: none does.
        limb: Number of the leg whose colour it has, or ``MAIN_BODY``.
        certainty: Share of the posterior that attaches it in this way.
        end: Its outermost point in its own frame, m; ``None``: the page does not list it.
        shapes: Shapes of the link.
    """

    name: str
    parent: int = -1
    place: Numbers = (0.0, 0.0, 0.0)
    turn: Numbers = _STRAIGHT
    axis: Numbers = (1.0, 0.0, 0.0)
    joint: int = -1
    limb: int = MAIN_BODY
    certainty: float = 1.0
    end: Numbers | None = None
    shapes: tuple[Shape, ...] = ()


def model_links(
    body: Morphology, names: Sequence[str] = (), certainties: Sequence[float] = ()
) -> tuple[Link, ...]:
    """A model as links, one per part after the main body.

    Args:
        body: The model.
        names: Names of its parts; default: no names.
        certainties: Share of the posterior that attaches each part in this way; default: all.
    """
    angles = body.part_angles(np.zeros(body.motors))
    limbs = _limb_numbers(body)
    main = Shape(kind="box", size=body.base.size)
    if body.base.round:
        main = Shape(kind="cylinder", size=(body.base.radius, body.base.size[2]))
    links = [Link(name="main body", shapes=(main,))]
    for row, part in enumerate(body.parts):
        links.append(
            Link(
                name=names[row] if names else "",
                parent=part.parent + 1,
                place=body.place(row),
                turn=_numbers(body.turn(row, angles[row])),
                axis=body.hinge(row).axis,
                joint=-1 if part.motor is None else part.motor,
                limb=limbs[row],
                certainty=certainties[row] if certainties else 1.0,
                end=(part.length, 0.0, 0.0),
                shapes=(_shape_of_part(part),),
            )
        )
    return tuple(links)


def _shape_of_part(part: Part) -> Shape:
    size = part.size if part.shape == "box" else (part.radius, part.far - part.near)
    return Shape(kind=part.shape, size=size, place=(part.middle, 0.0, 0.0))


def robot_links(urdf: Urdf, joints: Sequence[str], driven: Collection[int]) -> tuple[Link, ...]:
    """A robot as links.

    Args:
        urdf: The robot's body; parents come before children.
        joints: Names of the robot's joints in motor order; others stand at 0.
        driven: Numbers of the joints that carry a leg each.
    """
    limbs_of = {joints[motor]: limb for limb, motor in enumerate(sorted(driven))}
    shapes = {link.name: tuple(map(_shape_of, link.collisions)) for link in urdf.links}
    links = [Link(name=urdf.root, shapes=shapes[urdf.root])]
    numbered = {urdf.root: 0}
    for joint in urdf.joints:
        parent, child = numbered[joint.parent.link], joint.child.link
        turn, place = joint.origin.frame
        axis = np.array(numbers(joint.axis.xyz))
        is_driven = joint.type == "revolute" and joint.name in joints
        numbered[child] = len(links)
        links.append(
            Link(
                name=child,
                parent=parent,
                place=_numbers(place),
                turn=_numbers(turn),
                axis=_numbers(axis / np.linalg.norm(axis)),
                joint=joints.index(joint.name) if is_driven else -1,
                limb=limbs_of.get(joint.name, links[parent].limb),
                shapes=shapes[child],
            )
        )
    return tuple(links)


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(values.ravel().tolist())


def _limb_numbers(body: Morphology) -> list[int]:
    """For each part the number of the limb that moves it, by which legs are coloured."""
    motors = sorted(part.motor for part in body.parts if part.motor is not None)
    moving = [body.parts[group].motor for group in body.rigid_groups]
    return [MAIN_BODY if motor is None else motors.index(motor) for motor in moving]


def _shape_of(collision: Collision) -> Shape:
    """A shape of a URDF, in its link's frame."""
    turn, place = map(_numbers, collision.origin.frame)
    shape = collision.geometry.shape
    if isinstance(shape, Box):
        return Shape(kind="box", size=numbers(shape.size), place=place, turn=turn)
    if isinstance(shape, Cylinder):
        size = shape.radius, shape.length
        return Shape(kind="cylinder", size=size, place=place, turn=turn)
    assert shape is not None
    return Shape(kind="sphere", size=(shape.radius,), place=place, turn=turn)


_LYING: Final = rotation((0.0, 1.0, 0.0), math.pi / 2)
"""Rotation that turns a cylinder's axis from z to x."""


@dataclass(frozen=True, kw_only=True)
class Solid:
    """One shape at its place in a frame.

    Attributes:
        kind: Kind of shape.
        size: Box: its three extents; cylinder: radius and length (along z); sphere: radius; m.
        turn: Rotation, shape (3, 3).
        place: Position of its middle, m, shape (3,).
        limb: Number of the limb that it belongs to, in motor order, or ``MAIN_BODY``.
    """

    kind: Kind
    size: tuple[float, ...]
    turn: Array
    place: Array
    limb: int

    def lowest(self, up: Array) -> float:
        """Coordinate of its lowest point along the direction ``up``, from the origin, m."""
        along = up @ self.turn
        if self.kind == "box":
            reach = float(np.abs(along) @ np.array(self.size)) / 2
        elif self.kind == "cylinder":
            radius, length = self.size
            reach = abs(along[2]) * length / 2 + math.hypot(along[0], along[1]) * radius
        else:
            reach = self.size[0]
        return float(up @ self.place) - reach


def solids_of(links: Sequence[Link], angles: Sequence[float] | Array) -> list[Solid]:
    """The solids of a body in its main body's frame.

    Args:
        links: The body; parents come before children.
        angles: Angles of the robot's joints, rad, in motor order.
    """
    frames: list[tuple[Array, Array]] = []
    solids: list[Solid] = []
    for link in links:
        turn, place = np.reshape(link.turn, (3, 3)), np.array(link.place)
        if link.joint >= 0:
            x, y, z = link.axis
            turn = turn @ rotation((x, y, z), float(angles[link.joint]))
        if link.parent >= 0:
            parent_turn, parent_place = frames[link.parent]
            turn, place = parent_turn @ turn, parent_place + parent_turn @ place
        frames.append((turn, place))
        for shape in link.shapes:
            shape_turn, middle = turn @ np.reshape(shape.turn, (3, 3)), place + turn @ shape.place
            solids += _solids(shape, shape_turn, middle, link.limb)
    return solids


def _solids(shape: Shape, turn: Array, place: Array, limb: int) -> Iterator[Solid]:
    """A shape as solids; a capsule is a cylinder, if it has any length, and two spheres."""
    if shape.kind != "capsule":
        yield Solid(kind=shape.kind, size=shape.size, turn=turn, place=place, limb=limb)
        return
    radius, straight = shape.size
    for side in (-0.5, 0.5):
        end = place + side * straight * turn[:, 0]
        yield Solid(kind="sphere", size=(radius,), turn=np.eye(3), place=end, limb=limb)
    if straight > 0:
        yield Solid(
            kind="cylinder",
            size=(radius, straight),
            turn=turn @ _LYING,
            place=place,
            limb=limb,
        )


def at_rest(solids: Sequence[Solid], readings: Observation | None) -> list[Solid]:
    """The solids of a body, moved from its own frame to where its readings say it rests.

    Args:
        solids: Solids in the body's own frame.
        readings: Readings at rest. A tilt that was not read counts as level; ``None``: nothing was
            read.
    """
    turn = turn_at_rest(solids, readings or Observation(angles=()))
    lift = np.array([0.0, 0.0, -_lowest(solids, turn[2])])
    return [replace(item, turn=turn @ item.turn, place=turn @ item.place + lift) for item in solids]


def turn_at_rest(solids: Sequence[Solid], readings: Observation) -> Array:
    """Rotation from a body's own frame to the world's, shape (3, 3).

    Args:
        solids: Solids in the body's own frame.
        readings: Readings where the body rests.
    """
    up = _up(readings, upright=True)
    if readings.clearance_saturated and _belly_ray(solids, up) < (readings.clearance or 0.0):
        up = _up(readings, upright=False)
    ahead = np.array([1.0, 0.0, 0.0]) - up[0] * up
    size = np.linalg.norm(ahead)
    ahead = ahead / size if size > 0 else np.array([0.0, 0.0, -up[0]])  # the limit
    return np.array([ahead, np.cross(up, ahead), up])


def _up(readings: Observation, *, upright: bool) -> Array:
    """World up in the body's frame; the tilt leaves open whether the body lies on its back."""
    left, ahead = readings.tilt
    x, y, z = up_of((left or 0.0, ahead or 0.0))
    up = np.array([x, y, z if upright else -z])
    unit: Array = up / np.linalg.norm(up)
    return unit


def _lowest(solids: Sequence[Solid], up: Array) -> float:
    return min(item.lowest(up) for item in solids)


def _belly_ray(solids: Sequence[Solid], up: Array) -> float:
    """Distance from the belly's middle to the ground, m, if the body rests with ``up`` upwards."""
    main = next((solid for solid in solids if solid.limb == MAIN_BODY), None)
    if main is None or main.kind == "sphere":  # its belly is not known
        return math.inf
    belly = main.place - np.array([0.0, 0.0, main.size[-1] / 2])
    return belly_ray(float(up @ belly - _lowest(solids, up)), up)
