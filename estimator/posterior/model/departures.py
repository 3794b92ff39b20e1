"""Ways in which a robot may be built otherwise than a problem says.

A problem lists what a leg can sit on and how its hinge can turn it. A robot whose hinge was put in
askew is none of its bodies, but in some movements feels like one of them. Departures are bodies
next to those of the problem, by which such a robot is noticed.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.arrays import CENTRE, Bodies
from estimator.body.morphology import BASE, Array

_STUB: Final = 0.02  # of a part's length
_WORSE: Final = 4.0  # nats: what explains the readings so much worse is refuted


@dataclass(frozen=True, kw_only=True)
class Departure(ABC):
    """One way in which the robot may be built otherwise.

    Attributes:
        name: For people, as the rest of "a body with …".
        part: Index of the part that departs; none: all of them, or the main body.
    """

    name: str
    part: int | None = None

    @abstractmethod
    def of(self, bodies: Bodies) -> Bodies:
        """The same bodies built so."""


@dataclass(frozen=True, kw_only=True)
class Thickness(Departure):
    """Parts of another thickness.

    Attributes:
        factor: On their radii.
    """

    factor: float

    def of(self, bodies: Bodies) -> Bodies:
        """The same bodies with such parts."""
        radius = bodies.radius.copy()
        columns = slice(None) if self.part is None else self.part
        radius[:, columns] *= self.factor
        return bodies.changed(radius=radius)


@dataclass(frozen=True, kw_only=True)
class TurnedHinge(Departure):
    """The axis of one part's hinge turned about one of the part's own directions.

    Attributes:
        about: 0: along the part, 1: leftward, 2: upward in the planar pose.
        angle: rad.
    """

    part: int
    about: int
    angle: float

    def of(self, bodies: Bodies) -> Bodies:
        """The same bodies with such a hinge."""
        hinge = bodies.hinge.copy()
        hinge[:, self.part] += len(bodies.hinges)
        turned = bodies.hinges @ _rotation(self.about, self.angle).T
        return bodies.changed(hinge=hinge, hinges=np.vstack([bodies.hinges, turned]))


@dataclass(frozen=True, kw_only=True)
class OffZero(Departure):
    """A hinge that stands elsewhere than its servo believes: a horn put on askew.

    Attributes:
        angle: Of the hinge where the servo is at 0, rad.
    """

    part: int
    angle: float

    def of(self, bodies: Bodies) -> Bodies:
        """The same bodies with such a hinge."""
        zero = bodies.zero.copy()
        zero[:, self.part] += self.angle
        return bodies.changed(zero=zero)


@dataclass(frozen=True, kw_only=True)
class OtherFigure(Departure):
    """A figure of ``Bodies.base`` that is not what the problem takes it to be.

    The density of the parts, how the accelerometer is turned, what it makes of tilt, and how much
    too high the distance sensor reads.

    Attributes:
        column: Of ``Bodies.base``.
        factor: On the figure.
        offset: Added to it, rad or m.
    """

    column: int
    factor: float = 1.0
    offset: float = 0.0

    def of(self, bodies: Bodies) -> Bodies:
        """The same bodies with that figure."""
        base = bodies.base.copy()
        base[:, self.column] = self.factor * base[:, self.column] + self.offset
        return bodies.changed(base=base)


@dataclass(frozen=True, kw_only=True)
class OffCentre(Departure):
    """A main body whose mass is elsewhere than in its middle: a battery at one end.

    Attributes:
        axis: 0: forward, 1: leftward.
        share: How far, of the main body's extent along that axis.
    """

    axis: int
    share: float

    def of(self, bodies: Bodies) -> Bodies:
        """The same bodies with such a main body."""
        base = bodies.base.copy()
        base[:, CENTRE + self.axis] += self.share * base[:, self.axis]
        return bodies.changed(base=base)


@dataclass(frozen=True, kw_only=True)
class Travel(Departure):
    """Servos that turn farther than they are told, or less far.

    Attributes:
        factor: On the angle.
    """

    factor: float

    def of(self, bodies: Bodies) -> Bodies:
        """The same bodies with such servos."""
        travel = bodies.travel.copy()
        columns = slice(None) if self.part is None else self.part
        travel[:, columns] *= self.factor
        return bodies.changed(travel=travel)


@dataclass(frozen=True, kw_only=True)
class TurnedMount(Departure):
    """One part that points elsewhere from where it sits.

    Attributes:
        angle: Leftward in the planar pose, rad.
    """

    part: int
    angle: float

    def of(self, bodies: Bodies) -> Bodies:
        """The same bodies with the part so turned."""
        tables = (bodies.base_mounts, bodies.part_mounts)
        rotation = _rotation(2, self.angle)[:2, :2]
        turned = [np.hstack([table[:, :-2], table[:, -2:] @ rotation.T]) for table in tables]
        on_base = bodies.parent[:, self.part] == BASE
        mount = bodies.mount.copy()
        mount[:, self.part] += np.where(on_base, *map(len, tables))
        return bodies.changed(
            mount=mount,
            base_mounts=np.vstack([tables[0], turned[0]]),
            part_mounts=np.vstack([tables[1], turned[1]]),
        )


@dataclass(frozen=True, kw_only=True)
class Limp(Departure):
    """One part, and what it carries, hangs from a joint that its servo does not hold.

    Such parts support nothing, as if they had no length, and their ends lie on the ground.
    """

    part: int

    def of(self, bodies: Bodies) -> Bodies:
        """The same bodies with what hangs too short to hold anything up."""
        hanging = np.zeros(bodies.parent.shape, dtype=bool)
        hanging[:, self.part] = True
        rows = np.arange(len(bodies))
        for column in range(
            self.part + 1, bodies.parent.shape[1]
        ):  # a carrier comes before its parts
            carrier = bodies.parent[:, column]
            hanging[:, column] |= (carrier != BASE) & hanging[rows, carrier]
        return bodies.changed(
            length=np.where(hanging, _STUB, 1.0) * bodies.length, limp=bodies.limp | hanging
        )


@dataclass(frozen=True, kw_only=True)
class Doubt:
    """A body that departs from the problem, with the lengths that fit best.

    Attributes:
        departure: How it does.
        point: Its genes, shape (size,).
        gains: How much better than the best body of the problem it explains each interaction,
            nats, shape (k,).
    """

    departure: Departure
    point: Array
    gains: Array

    @property
    def is_left(self) -> bool:
        """Whether it explains the readings about as well."""
        return bool(self.gains.sum() > -_WORSE)

    @property
    def clear_gain(self) -> float:
        """Sum of the gains but the largest, nats.

        An interaction that ended elsewhere may gain much by accident.
        """
        return float(self.gains.sum() - self.gains.max())


def _rotation(about: int, angle: float) -> Array:
    cosine, sine = math.cos(angle), math.sin(angle)
    one, two = (about + 1) % 3, (about + 2) % 3
    matrix = np.eye(3)
    matrix[one, one] = matrix[two, two] = cosine
    matrix[one, two], matrix[two, one] = -sine, sine
    return matrix
