"""Whether two bodies can be told apart by what they feel.

Some differences cannot be felt: the hinge of a part that is locked, a roll with nothing off its
axis, where a locked leg is divided into upper and lower part, and, without tilt, the symmetries of
a square main body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from estimator.morphology import Array, Morphology
from estimator.physics.base import Flags, Physics, Readings

PROGRAMS: Final = 500
AGREEMENT: Final = 0.99
"""Share of the programs that must agree: some poses balance on an edge, where a rounding error
decides which way the body falls."""

TILT_TOLERANCE: Final = math.radians(0.5)
CLEARANCE_TOLERANCE: Final = 2e-3  # m


def equivalent(
    bodies: Sequence[Morphology],
    reference: Morphology,
    programs: Array,
    physics: Physics,
    modalities: Sequence[str],
) -> list[bool]:
    """Whether each body reads like the reference on (nearly) all motor programs.

    Args:
        bodies: Bodies with the reference's motors and sensors.
        reference: What they are compared with.
        programs: Motor programs, rad, shape (programs, motors).
        physics: Computes noise-free readings.
        modalities: Sensors that may tell bodies apart.
    """
    if not bodies:
        return []
    readings = physics.read(
        [(body, program) for body in (reference, *bodies) for program in programs]
    )
    rows = np.arange(len(readings)).reshape(-1, len(programs))
    first = readings[rows[0]]
    return [
        float(np.mean(_agree(first, readings[row], modalities))) >= AGREEMENT for row in rows[1:]
    ]


def _agree(one: Readings, other: Readings, modalities: Sequence[str]) -> Flags:
    """Programs in which two bodies feel the same; those that neither can perform say nothing."""
    same = one.valid & other.valid
    if "touch" in modalities:
        doubtful = one.touch_doubtful | other.touch_doubtful
        same &= np.all((one.touch == other.touch) | doubtful, axis=1)
    if "tilt" in modalities:
        same &= np.all(np.abs(one.tilt - other.tilt) <= TILT_TOLERANCE, axis=1)
    if "clearance" in modalities:
        same &= np.abs(one.clearance - other.clearance) <= CLEARANCE_TOLERANCE
    found: Flags = same | ~(one.valid | other.valid)
    return found
