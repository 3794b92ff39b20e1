"""Bodies as solids in the world, at rest in a pose of which only the readings are known.

Nothing is simulated here. The angles say where the parts are on the body, the tilt says which way
is up, and whatever is lowest lies on the ground; only the heading stays open, and is chosen so that
the body's front points along x. So a robot is shown as its own sensors describe it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from estimator.body.morphology import Array, rotation
from estimator.readings.observation import Observation
from estimator.report.bodies.jointed_body import MAIN_BODY, Kind, Link, Shape
from protocol.wire.readings import belly_ray, up_of

_LYING: Final = rotation((0.0, 1.0, 0.0), math.pi / 2)
"""Turns a cylinder from z to x."""


@dataclass(frozen=True, kw_only=True)
class Solid:
    """One shape.

    Attributes:
        kind: Of shape.
        size: Box: its three extents; cylinder: radius and length (along z); sphere: radius; m.
        turn: Rotation, shape (3, 3).
        place: Of its middle, m, shape (3,).
        limb: Number of the limb that it belongs to, in motor order, or ``MAIN_BODY``.
    """

    kind: Kind
    size: tuple[float, ...]
    turn: Array
    place: Array
    limb: int

    def lowest(self, up: Array) -> float:
        """Its least extent along a direction, m, from the origin."""
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
    """A body in its main body's frame.

    Args:
        links: The body; parents come before children.
        angles: Of the robot's joints, rad, in motor order.
    """
    frames: list[tuple[Array, Array]] = []
    solids: list[Solid] = []
    for link in links:
        turn, place = np.reshape(link.turn, (3, 3)), np.array(link.place)
        if link.joint >= 0:
            x, y, z = link.axis
            turn = turn @ rotation((x, y, z), float(angles[link.joint]))
        if link.parent >= 0:
            outer, at = frames[link.parent]
            turn, place = outer @ turn, at + outer @ place
        frames.append((turn, place))
        for shape in link.shapes:
            own, middle = turn @ np.reshape(shape.turn, (3, 3)), place + turn @ shape.place
            solids += _solids(shape, own, middle, link.limb)
    return solids


def _solids(shape: Shape, turn: Array, place: Array, limb: int) -> Iterator[Solid]:
    """A shape; a capsule is a cylinder, if it has any length, and its two ends."""
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


def at_rest(solids: Sequence[Solid], felt: Observation | None) -> list[Solid]:
    """The solids of a body, moved from its own frame to where its readings say it rests.

    Args:
        solids: In the body's own frame.
        felt: The readings. A tilt that was not read counts as level; ``None``: nothing was.
    """
    turn = turn_at_rest(solids, felt or Observation(angles=()))
    lift = np.array([0.0, 0.0, -_lowest(solids, turn[2])])
    return [replace(item, turn=turn @ item.turn, place=turn @ item.place + lift) for item in solids]


def turn_at_rest(solids: Sequence[Solid], felt: Observation) -> Array:
    """Rotation from a body's own frame to the world's; arguments as above."""
    up = _up(felt, upright=True)
    if felt.clearance_saturated and _belly_ray(solids, up) < (felt.clearance or 0.0):
        up = _up(felt, upright=False)
    ahead = np.array([1.0, 0.0, 0.0]) - up[0] * up
    ahead = ahead / np.linalg.norm(ahead)
    return np.array([ahead, np.cross(up, ahead), up])


def _up(felt: Observation, *, upright: bool) -> Array:
    """World up in the body's frame; the tilt leaves open whether the body lies on its back."""
    left, ahead = felt.tilt
    x, y, z = up_of((left or 0.0, ahead or 0.0))
    up = np.array([x, y, z if upright else -z])
    unit: Array = up / np.linalg.norm(up)
    return unit


def _lowest(solids: Sequence[Solid], up: Array) -> float:
    return min(item.lowest(up) for item in solids)


def _belly_ray(solids: Sequence[Solid], up: Array) -> float:
    """From the belly's middle to the ground, m, if the body rests with ``up``."""
    boxes = (item for item in solids if item.limb == MAIN_BODY and item.kind == "box")
    box = next(boxes, None)
    if box is None:  # a robot of another shape: nobody knows its belly
        return math.inf
    belly = box.place - np.array([0.0, 0.0, box.size[2] / 2])
    return belly_ray(float(up @ belly - _lowest(solids, up)), up)
