"""Bodies as limbs: what moves as one piece, with its length and how it is attached.

A limb is a part with everything that is rigidly joined to it: at a locked hinge no sensor shows
where one part ends and the next begins. For a quadruped with locked knees the limbs are its legs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimator.body.morphology import BASE, Array, Morphology, part_frames, tips


@dataclass(frozen=True, kw_only=True)
class Limb:
    """One limb.

    Attributes:
        motor: The motor that turns it, or ``None`` where it is locked to the main body.
        parent: Motor of the limb that it sits on; ``BASE``: the main body, or a limb locked to it.
        mount: Name of what it sits on there.
        hinge: Name of its hinge: how a positive angle moves it.
        length: Its joint's axis to its far end, measured away from its parent, m.
        sensors: The touch sensors that it carries.
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
    reaches = _reaches(morphology, members_of)
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
                length=reaches.get(root, part.length),
                sensors=tuple(sorted(sensor for sensor in sensors if sensor is not None)),
            )
        )
    return tuple(sorted(unordered, key=lambda limb: (limb.motor is None, limb.motor or 0)))


def _reaches(morphology: Morphology, members_of: Mapping[int, Sequence[int]]) -> dict[int, float]:
    """How far each limb of several rigid parts extends along its first, m, by its first part."""
    several = {root: members for root, members in members_of.items() if len(members) > 1}
    if not several:
        return {}
    origins, rotations = frames = part_frames(morphology, np.zeros(morphology.motors))
    far_ends = tips(morphology, frames)
    return {
        root: max(float((far_ends[one] - origins[root]) @ rotations[root, :, 0]) for one in members)
        for root, members in several.items()
    }


def driven_limbs(body: Morphology) -> tuple[Limb, ...]:
    """The limbs that motors turn, in motor order."""
    return tuple(limb for limb in limbs(body) if limb.motor is not None)


def leg_lengths(bodies: Sequence[Morphology]) -> Array:
    """Length of each body's legs, m, shape (bodies, legs)."""
    return np.array([[limb.length for limb in driven_limbs(body)] for body in bodies])
