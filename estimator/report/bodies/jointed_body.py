"""A body as links and joints: what a page needs to pose it, whether it is a model or a URDF."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict

from estimator.body.morphology import BASE, Array, Morphology, part_frames
from estimator.evaluation.truth.urdf import Urdf, numbers
from estimator.report.bodies.scene import MAIN_BODY, frame_of, limb_numbers, shape_of

Numbers: TypeAlias = tuple[float, ...]

_DIGITS: Final = 7
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

    kind: str
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
    body: Morphology, names: Sequence[str], certainties: Sequence[float] = ()
) -> tuple[Link, ...]:
    """A model as links, one per part after the main body.

    Args:
        body: The model.
        names: Of its parts.
        certainties: Share of the posterior that attaches each part so; default: all.
    """
    origins, turns = part_frames(body, np.zeros(body.motors))
    _, turned = part_frames(body, np.full(body.motors, math.pi / 2))
    limbs = limb_numbers(body)
    links = [Link(name="main body", shapes=(Shape(kind="box", size=body.base.size),))]
    for row, (part, name) in enumerate(zip(body.parts, names, strict=True)):
        on_base = part.parent == BASE
        origin = np.zeros(3) if on_base else origins[part.parent]
        straight = np.eye(3) if on_base else turns[part.parent]
        bent = np.eye(3) if on_base else turned[part.parent]
        turn = straight.T @ turns[row]
        links.append(
            Link(
                name=name,
                parent=part.parent + 1,
                place=_rounded(straight.T @ (origins[row] - origin)),
                turn=_rounded(turn),
                axis=_rounded(_axis_of(turn.T @ bent.T @ turned[row])),
                joint=-1 if part.motor is None else part.motor,
                limb=limbs[row],
                certainty=certainties[row] if certainties else 1.0,
                end=_rounded((part.length, 0.0, 0.0)),
                shapes=(
                    Shape(
                        kind="capsule",
                        size=_rounded((part.radius, part.far_centre - part.near_centre)),
                        place=_rounded(((part.near_centre + part.far_centre) / 2, 0.0, 0.0)),
                    ),
                ),
            )
        )
    return tuple(links)


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
                size=_rounded(size),
                place=_rounded(place),
                turn=_rounded(turn),
            )
            for collision in link.collisions
            for kind, size in (shape_of(collision.geometry.shape),)
            for turn, place in (frame_of(collision.origin),)
        )
        for link in urdf.links
    }
    links = [Link(name=urdf.root, shapes=shapes[urdf.root])]
    numbered = {urdf.root: 0}
    for joint in urdf.joints:
        parent, child = numbered[joint.parent.link], joint.child.link
        turn, place = frame_of(joint.origin)
        axis = np.array(numbers(joint.axis.xyz))
        moved = joint.type == "revolute" and joint.name in joints
        numbered[child] = len(links)
        links.append(
            Link(
                name=child,
                parent=parent,
                place=_rounded(place),
                turn=_rounded(turn),
                axis=_rounded(axis / np.linalg.norm(axis)),
                joint=joints.index(joint.name) if moved else -1,
                limb=limbs_of.get(joint.name, links[parent].limb),
                shapes=shapes[child],
            )
        )
    return tuple(links)


def _axis_of(quarter: Array) -> Array:
    """Axis of a quarter turn; of none at all, any."""
    axis = np.array(
        [
            quarter[2, 1] - quarter[1, 2],
            quarter[0, 2] - quarter[2, 0],
            quarter[1, 0] - quarter[0, 1],
        ]
    )
    axis = axis / 2
    return axis if np.linalg.norm(axis) > 0.5 else np.array([1.0, 0.0, 0.0])


def _rounded(values: Array | Sequence[float]) -> Numbers:
    return tuple((np.round(np.asarray(values, dtype=float).ravel(), _DIGITS) + 0.0).tolist())
