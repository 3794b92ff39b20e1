"""Forward kinematics of bodies, which physics, pictures and files are held against."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimator.body.morphology import BASE, Array, Morphology


def part_frames(body: Morphology, program: Sequence[float] | Array) -> tuple[Array, Array]:
    """Origins, shape (n, 3), m, and rotations, shape (n, 3, 3), of n parts in the body frame.

    Args:
        body: Theirs.
        program: Angle of each motor, rad.
    """
    origins, rotations = np.empty((len(body.parts), 3)), np.empty((len(body.parts), 3, 3))
    for index, angle in enumerate(body.part_angles(program)):
        parent = body.parts[index].parent
        turn = np.eye(3) if parent == BASE else rotations[parent]
        start = np.zeros(3) if parent == BASE else origins[parent]
        origins[index] = start + turn @ body.place(index)
        rotations[index] = turn @ body.turn(index, angle)
    return origins, rotations


def tips(body: Morphology, program: Sequence[float] | Array) -> Array:
    """Outermost point of each part in the body frame, m, shape (n, 3)."""
    origins, rotations = part_frames(body, program)
    lengths = np.array([part.length for part in body.parts], dtype=float)
    far_ends: Array = origins + lengths[:, None] * rotations[:, :, 0]
    return far_ends
