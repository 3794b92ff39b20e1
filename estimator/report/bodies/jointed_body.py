"""A body as links and joints: what a page needs to pose it, whether it is a model or a URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, PlainSerializer

from estimator.body.morphology import Array, Morphology, Part, rotation
from estimator.evaluation.truth.urdf import Box, Cylinder, Origin, Sphere, Urdf, numbers

MAIN_BODY: Final = -1
"""In place of a limb's number: the link belongs to the main body."""

_DIGITS: Final = 7


def _rounded(values: Sequence[float]) -> list[float]:
    """Numbers as a page takes them."""
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
        place: Of its middle in the link's frame, m.
        turn: Of the shape in the link's frame, nine numbers row by row.
    """

    kind: Kind | Literal["capsule"]
    size: Numbers
    place: Numbers = (0.0, 0.0, 0.0)
    turn: Numbers = _STRAIGHT


class Link(_Record):
    """What moves as one piece; link 0 is the main body.

    Attributes:
        name: For people.
        parent: An earlier link; −1 for the main body.
        place: Of its joint in the parent's frame, m.
        turn: Of its frame in the parent's while its joint stands at 0, nine numbers row by row.
        axis: Of its joint, in its own frame.
        joint: Index of the robot's joint that turns it; −1: none does.
        limb: Which leg's colour it has, or ``MAIN_BODY``.
        certainty: Share of the posterior that attaches it so.
        end: Its outermost point in its own frame, m; ``None`` where that has no name.
        shapes: What it looks like.
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
        names: Of its parts, where anybody reads them.
        certainties: Share of the posterior that attaches each part so; default: all.
    """
    angles = body.part_angles(np.zeros(body.motors))
    limbs = _limb_numbers(body)
    links = [Link(name="main body", shapes=(Shape(kind="box", size=body.base.size),))]
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


def robot_links(urdf: Urdf, joints: Sequence[str], limbs_of: Mapping[str, int]) -> tuple[Link, ...]:
    """A robot as links.

    Args:
        urdf: Its body; parents come before children.
        joints: Names of the robot's joints in motor order; others stand at 0.
        limbs_of: Number of the limb that each joint carries, by the joint's name.
    """
    shapes = {
        link.name: tuple(
            Shape(
                kind=kind,
                size=size,
                place=_numbers(place),
                turn=_numbers(turn),
            )
            for collision in link.collisions
            for kind, size in (_shape_of(collision.geometry.shape),)
            for turn, place in (_frame_of(collision.origin),)
        )
        for link in urdf.links
    }
    links = [Link(name=urdf.root, shapes=shapes[urdf.root])]
    numbered = {urdf.root: 0}
    for joint in urdf.joints:
        parent, child = numbered[joint.parent.link], joint.child.link
        turn, place = _frame_of(joint.origin)
        axis = np.array(numbers(joint.axis.xyz))
        moved = joint.type == "revolute" and joint.name in joints
        numbered[child] = len(links)
        links.append(
            Link(
                name=child,
                parent=parent,
                place=_numbers(place),
                turn=_numbers(turn),
                axis=_numbers(axis / np.linalg.norm(axis)),
                joint=joints.index(joint.name) if moved else -1,
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


def _frame_of(origin: Origin) -> tuple[Array, Array]:
    """Rotation and place, m, that a URDF's origin stands for."""
    roll, pitch, yaw = numbers(origin.rpy)
    inner = rotation((0.0, 0.0, 1.0), yaw) @ rotation((0.0, 1.0, 0.0), pitch)
    inner = inner @ rotation((1.0, 0.0, 0.0), roll)
    return inner, np.array(numbers(origin.xyz))


def _shape_of(shape: Box | Cylinder | Sphere | None) -> tuple[Kind, tuple[float, ...]]:
    """Kind and size of a URDF's shape, as a ``Shape`` has them."""
    if isinstance(shape, Box):
        return "box", numbers(shape.size)
    if isinstance(shape, Cylinder):
        return "cylinder", (shape.radius, shape.length)
    assert shape is not None
    return "sphere", (shape.radius,)
