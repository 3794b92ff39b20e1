"""Bodies as limbs: what moves as one piece, with its length and how it is attached.

A limb is a part with everything that is rigidly joined to it: at a locked hinge no sensor shows
where one part ends and the next begins. For a quadruped with locked knees the limbs are its legs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.body.morphology import BASE, Array, Morphology


@dataclass(frozen=True, kw_only=True)
class Limb:
    """One limb.

    Attributes:
        motor: Index of the motor that turns it, or ``None`` where it is locked to the main body.
        parent: Motor of the limb that it sits on; ``BASE``: the main body, or a limb locked to it.
        mount: Name of the mount that it sits on there.
        hinge: Name of its hinge: how a positive angle moves it.
        length: Length from its joint's axis to its far end, measured away from its parent, m.
        sensors: Indices of the touch sensors that it carries.
    """

    motor: int | None
    parent: int
    mount: str
    hinge: str
    length: float
    sensors: tuple[int, ...] = ()


def limbs(morphology: Morphology) -> tuple[Limb, ...]:
    """The limbs of a body: those that a motor turns in the order of their motors, then the rest."""
    groups = morphology.rigid_groups
    members_of = {
        root: [index for index, group in enumerate(groups) if group == root]
        for root in sorted(set(groups))
    }
    unordered = []
    for root, members in members_of.items():
        part = morphology.parts[root]
        sensors = (morphology.parts[index].sensor for index in members)
        parent = None if part.parent == BASE else morphology.parts[groups[part.parent]].motor
        unordered.append(
            Limb(
                motor=part.motor,
                parent=BASE if parent is None else parent,
                mount=morphology.mount(root).name,
                hinge=morphology.hinge(root).name,
                length=_reach(morphology, members),
                sensors=tuple(sorted(sensor for sensor in sensors if sensor is not None)),
            )
        )
    return tuple(sorted(unordered, key=lambda limb: (limb.motor is None, limb.motor or 0)))


def _reach(morphology: Morphology, members: Sequence[int]) -> float:
    """How far a limb, made of the rigid parts ``members``, extends along the first of them, m."""
    parts, root = morphology.parts, members[0]
    starts, turns = {root: 0.0}, {root: np.eye(3)}  # along the first part; rotations in its frame
    for index in members[1:]:
        turn = turns[parts[index].parent]
        starts[index] = starts[parts[index].parent] + float(turn[0] @ morphology.place(index))
        turns[index] = turn @ morphology.turn(index, 0.0)
    return max(starts[i] + float(turns[i][0, 0]) * parts[i].length for i in members)


def driven_limbs(body: Morphology) -> tuple[Limb, ...]:
    """The limbs that motors turn, in motor order."""
    return tuple(limb for limb in limbs(body) if limb.motor is not None)


def leg_lengths(bodies: Sequence[Morphology]) -> Array:
    """Length of each body's legs, its driven limbs, m, shape (bodies, legs)."""
    return np.array([[limb.length for limb in driven_limbs(body)] for body in bodies])
