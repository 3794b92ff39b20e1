"""Whether two bodies can be told apart by what they feel.

Some differences cannot be felt: the hinge of a part that is locked, a roll with nothing off its
axis, where a locked leg is divided into upper and lower part, and, without tilt, the symmetries of
a square main body.

Readings are computed by statics, which treats equal bodies alike however they are put down; in
PyBullet they differ in one program of thirty. Where a trifle decides on which feet a body comes to
rest, even statics must take one side, so such programs say nothing. Of the others nearly all must
agree, and bodies that differ in fewer poses than that pass as equivalent, for example by the hinge
of a leg too short to reach the ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from estimator.body.morphology import BASE, SIDES, Array, Morphology
from estimator.physics.base import Flags, MarginPhysics, Readings
from estimator.readings.modalities.registry import MODALITIES

PROGRAMS: Final = 500
AGREEMENT: Final = 0.99
"""Share of the programs that must agree, of those that say anything. Equal quadrupeds (turned,
mirrored, with a leg that only rolls) agree in all of them; bodies that differ as little as by the
direction in which one leg swings sideways, in 0.92."""

MARGIN: Final = math.radians(0.05)
"""A program says something if gravity could be inclined by more than this without the body landing
elsewhere."""


class Reference:
    """A body that others are compared with.

    Args:
        body: The body.
        programs: Motor programs, rad, shape (programs, motors).
        physics: Computes what bodies feel.
        modalities: Sensors that may tell bodies apart.
    """

    def __init__(
        self, body: Morphology, programs: Array, physics: MarginPhysics, modalities: Sequence[str]
    ):
        self._programs = programs
        self._physics = physics
        self._modalities = tuple(modalities)
        self._felt = self._read(body)
        margins = physics.path_margins([(body, program) for program in programs])
        self._tells: Flags = margins > MARGIN

    def is_like(self, body: Morphology) -> bool:
        """Whether a body reads like this one in (nearly) all programs that say anything.

        Args:
            body: A body with the reference's motors and sensors.
        """
        same = agree(self._felt, self._read(body), self._modalities)[self._tells]
        return bool(same.size) and float(np.mean(same)) >= AGREEMENT

    def _read(self, body: Morphology) -> Readings:
        return self._physics.read([(body, program) for program in self._programs])


def turned(body: Morphology, quarters: int) -> Morphology:
    """The body with everything that sits on its main body turned leftward by quarter turns.

    On a square main body (and by two quarters on any) that is the same body, seen from elsewhere.
    """
    return replace(
        body,
        parts=tuple(
            replace(part, side=(part.side - quarters) % len(SIDES)) if part.parent == BASE else part
            for part in body.parts
        ),
    )


def mirrored(body: Morphology) -> Morphology:
    """The body as its left-right mirror image, the same motors turning the images of their parts.

    What a positive angle does is mirrored too: yaw and roll change hands, up stays up.
    """
    sides, hinges = (2, 1, 0, 3), (1, 0, 2, 3, 5, 4)
    return replace(
        body,
        parts=tuple(
            replace(part, side=sides[part.side], hinge=hinges[part.hinge]) for part in body.parts
        ),
    )


def agree(one: Readings, other: Readings, modalities: Sequence[str]) -> Flags:
    """Programs in which two bodies feel the same; those that neither can perform count as such."""
    same = one.valid & other.valid
    for name in modalities:
        same &= MODALITIES[name].alike(one, other)
    alike: Flags = same | ~(one.valid | other.valid)
    return alike
