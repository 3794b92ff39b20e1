"""Whether two bodies are indistinguishable by their sensors.

Some differences show in no sensor: the hinge of a part that is locked, a roll with nothing off its
axis, where a locked leg is divided into upper and lower part, and, without tilt, the symmetries of
a square main body.

Readings are computed by statics, which treats equal bodies alike however they are put down; in
PyBullet equal bodies differ in one program of thirty. Where next to nothing decides on which feet a
body comes to rest, even statics must take one side, so such programs say nothing (``MARGIN``). Of
the other programs nearly all must agree, and bodies that differ in few of them pass as equivalent,
for example by the hinge of a leg too short to reach the ground.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Bodies, Flags
from estimator.body.morphology import BASE, Array, Morphology, Part, direction, rotation
from estimator.body.mounts import Mount
from estimator.errors import MorphologyError
from estimator.physics.base import ArrayPhysics
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import PredictedReadings

PROGRAMS: Final = 500
"""Number of random motor programs in which bodies are compared."""

AGREEMENT: Final = 0.99
"""Share of the programs that must agree, of those that say anything. Equal quadrupeds (turned,
mirrored, with a leg that only rolls) agree in all of them; bodies that differ as little as by the
direction in which one leg swings sideways, in 0.92."""

_FIRST_PROGRAMS: Final = 50  # programs compared first: nearly all bodies that differ do so in these

MARGIN: Final = math.radians(0.05)
"""A program says something if gravity could be inclined by more than this, rad, without the body
landing elsewhere."""

_FAILED_DIFFERENCE: Final = (
    200.0  # difference, in tolerances, of a body that cannot perform a program; any large number
)

_COINCIDENT: Final = 1e-6  # m, or difference of unit vectors: far above rounding

Indices: TypeAlias = NDArray[np.intp]


Read: TypeAlias = Callable[[Indices, Indices], PredictedReadings]
"""Predicts readings of numbered bodies after numbered motor programs, a row for each pair."""


def indistinguishable(
    one: Read,
    other: Read,
    margins: Callable[[Indices, Indices], Array],
    shape: tuple[int, int],
    modalities: Sequence[str],
) -> Flags:
    """Whether bodies read alike, pair by pair, in (nearly) all programs that say anything.

    Args:
        one: Predicts readings of the first body of each pair.
        other: Predicts readings of the second body of each pair.
        margins: Path margins of the first body of each pair, rad; those above ``MARGIN`` need not
            be exact.
        shape: Number of pairs, and of programs.
        modalities: Sensors that may discriminate between bodies.

    Returns:
        Whether each pair reads alike, shape (pairs,).
    """
    pairs, programs = shape
    allowed = int((1 - AGREEMENT) * programs)
    differing = np.zeros(pairs, dtype=np.int64)
    for batch in np.split(np.arange(programs), [_FIRST_PROGRAMS]):
        candidates = np.flatnonzero(differing <= allowed)
        rows, performed = np.repeat(candidates, len(batch)), np.tile(batch, len(candidates))
        if not rows.size:
            break
        readings = one(rows, performed), other(rows, performed)
        differ = ~agree(*readings, modalities).reshape(len(candidates), len(batch))
        # Margins cost as much as many readings: they are asked for twice as many as may differ.
        asked = np.flatnonzero(differ & (np.cumsum(differ, axis=1) <= 2 * (allowed + 1)))
        is_informative = np.zeros(differ.size, dtype=bool)
        is_informative[asked] = margins(rows[asked], performed[asked]) > MARGIN
        differing[candidates] += is_informative.reshape(differ.shape).sum(axis=1)
    return np.asarray(differing <= allowed)


class Reference:
    """A body that others are compared with.

    Args:
        body: The body.
        programs: Motor programs, rad, shape (programs, motors).
        physics: Predicts readings.
        modalities: Sensors that may discriminate between bodies.

    Attributes:
        informative: Numbers of the programs that say anything and that the body can perform.
    """

    def __init__(
        self,
        body: Morphology,
        programs: Array,
        physics: ArrayPhysics,
        modalities: Sequence[str],
    ):
        self._programs = programs
        self._physics = physics
        self._modalities = tuple(modalities)
        self._readings = self._read(body, np.arange(len(programs)))
        self._margins = physics.path_margins([(body, program) for program in programs])
        self._decided: Flags = self._margins > MARGIN
        self.informative: Indices = np.flatnonzero(self._decided & self._readings.valid)

    def is_like(self, body: Morphology) -> bool:
        """Whether a body reads like this one in (nearly) all programs that say anything.

        Args:
            body: A body with the reference's motors and sensors.
        """
        informative = np.flatnonzero(self._decided)
        (is_alike,) = indistinguishable(
            lambda _, programs: self._readings[informative[programs]],
            lambda _, programs: self._read(body, informative[programs]),
            lambda _, programs: self._margins[informative[programs]],
            (1, len(informative)),
            self._modalities,
        )
        return bool(is_alike) and bool(informative.size)

    def residuals(self, bodies: Bodies, programs: Indices) -> Array:
        """Differences of many bodies' readings from the reference's.

        Args:
            bodies: n bodies with the reference's motors and sensors.
            programs: Numbers of m programs among ``informative``.

        Returns:
            Differences, shape (n, m, values), in units of the sensors' tolerances, so that 1 is
            hardly discriminated; very large for a program that a body cannot perform.
        """
        rows = np.repeat(np.arange(len(bodies)), len(programs))
        performed = np.tile(programs, len(bodies))
        their_readings = self._physics.read_bodies(bodies[rows], self._programs[performed])
        differences = np.hstack(
            [
                MODALITIES[name].differences(their_readings, self._readings[performed])
                for name in self._modalities
            ]
        )
        differences[~their_readings.valid] = _FAILED_DIFFERENCE
        return differences.reshape(len(bodies), len(programs), -1)

    def _read(self, body: Morphology, programs: Indices) -> PredictedReadings:
        return self._physics.read([(body, program) for program in self._programs[programs]])


def turned(body: Morphology, quarters: float) -> Morphology:
    """The body with everything that sits on its main body turned leftward by quarter turns.

    On a square main body (and by two quarters on any, by any turn on a round one) that is the same
    body, seen from elsewhere.

    Raises:
        MorphologyError: There is no mount where a part would come to sit.
    """
    turn = rotation((0.0, 0.0, 1.0), quarters * math.pi / 2)

    def image(part: Part) -> Part:
        if part.parent != BASE:
            return part
        return replace(part, mount=_base_mount(body, part.mount, turn))

    return replace(body, parts=tuple(map(image, body.parts)))


def mirrored(body: Morphology) -> Morphology:
    """The body as its left-right mirror image, the same motors turning the images of their parts.

    What a positive angle does is mirrored too: yaw and roll change hands, up stays up.

    Raises:
        MorphologyError: There is no mount where a part would come to sit, or no such hinge.
    """

    def image(part: Part) -> Part:
        if part.parent == BASE:
            mount = _base_mount(body, part.mount, np.diag([1.0, -1.0, 1.0]))
        else:
            carried = body.part_mounts[part.mount]
            places = np.array([[m.fraction, *_axes(m).ravel()] for m in body.part_mounts])
            opposite = _axes(replace(carried, yaw=-carried.yaw)).ravel()
            mount = _nearest(places, (carried.fraction, *opposite), "mount")
        x, y, z = body.hinges[part.hinge].axis
        axes = np.array([hinge.axis for hinge in body.hinges])
        return replace(part, mount=mount, hinge=_nearest(axes, (-x, y, -z), "hinge"))

    return replace(body, parts=tuple(map(image, body.parts)))


def images(body: Morphology) -> Iterator[Morphology]:
    """Yields the body turned, then its mirror image turned, as far as it has the mounts.

    It is turned by quarter turns; if its main body is round, by those from its first mount to each.
    """
    turns: Sequence[float] = range(4)
    if body.base.round:
        yaws = [math.atan2(*mount.at[1::-1]) for mount in body.base.mounts]
        turns = [(yaw - yaws[0]) / (math.pi / 2) for yaw in yaws]
    for quarters in turns:
        with suppress(MorphologyError):
            yield turned(body, quarters)
    for quarters in turns:
        with suppress(MorphologyError):
            yield turned(mirrored(body), quarters)


def _base_mount(body: Morphology, mount: int, change: Array) -> int:
    """Index of the mount on the main body where a rotation or reflection carries another."""
    mounts = body.base.mounts
    places = np.array([[candidate.at, *_axes(candidate)] for candidate in mounts])
    wanted = (places[mount] @ change.T).ravel()
    return _nearest(places.reshape(len(mounts), -1), wanted, "mount")


def _axes(mount: Mount) -> Array:
    """The x and z axes of a part on a mount, its hinge at 0, shape (2, 3)."""
    turned = direction(mount)
    return np.array([turned[:, 0], turned[:, 2]])


def _nearest(rows: Array, wanted: Sequence[float] | Array, what: str) -> int:
    distances = np.abs(rows - np.asarray(wanted)).max(axis=1)
    if distances.min() > _COINCIDENT:
        raise MorphologyError(f"the body has no {what} where an image of another would be")
    return int(np.argmin(distances))


def agree(one: PredictedReadings, other: PredictedReadings, modalities: Sequence[str]) -> Flags:
    """Whether, in each program, two bodies' sensors read alike, or neither can perform it."""
    agreed = one.valid & other.valid
    for name in modalities:
        agreed &= MODALITIES[name].alike(one, other)
    alike: Flags = agreed | ~(one.valid | other.valid)
    return alike
