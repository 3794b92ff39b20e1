"""Deviations of a robot from what its problem states.

A problem lists what a leg can sit on and how its hinge can turn it. A robot whose hinge was put in
askew is none of its bodies, but in some movements feels like one of them. Deviations are bodies
next to those of the problem, by which such a robot is noticed.

``possible_deviations`` lists all that are fitted to the readings. Their amounts are what a builder
gets wrong unnoticed: less hardly matters, more is seen. Of each amount all of ``SIZES`` times as
much are fitted.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar, Final, TypedDict

import numpy as np

from estimator.body.arrays import (
    ACCELEROMETER,
    BASE_YAW,
    CENTRE,
    LEVEL,
    PART_YAW,
    TOO_HIGH,
    Bodies,
    Integers,
)
from estimator.body.morphology import BASE, Array
from estimator.problem.problem import Problem
from estimator.problem.sections import NuisanceSection

_STUB: Final = 0.02  # of a part's length
_WORSE: Final = 4.0  # nats: what explains the readings so much worse is refuted


@dataclass(frozen=True, kw_only=True)
class Deviation(ABC):
    """One deviation of a robot from what its problem states.

    Attributes:
        text: For people, as the rest of "a body with …"; braces stand for the amount.
        amount: How far it goes, rad, m, or as a factor.
        unit: Factor on the amount in the text.
        part: Index of the part that deviates; none: all of them, or the main body.
    """

    is_factor: ClassVar[bool] = False

    text: str
    amount: float = 1.0
    unit: float = 1.0
    part: int | None = None

    @property
    def name(self) -> str:
        """The text with the amount."""
        return self.text.replace("{}", f"{abs(self.amount) * self.unit:.2g}")

    def of(self, bodies: Bodies, sizes: Array | float = 1.0) -> Bodies:
        """The bodies with this deviation.

        Args:
            bodies: n bodies of the problem.
            sizes: How far each deviates, shape (n,); 0: not at all, 1: by the amount.
        """
        return self._built(bodies, self._amounts(np.broadcast_to(sizes, len(bodies))))

    def sized(self, size: float) -> Deviation:
        """This deviation with an amount of so many times its own."""
        return replace(self, amount=float(self._amounts(np.array(size))))

    @property
    def kind(self) -> Deviation:
        """The deviation without its amount: deviations of one kind are built at once."""
        return replace(self, text="", amount=1.0, unit=1.0)

    @property
    def family(self) -> tuple[str, bool]:
        """Its class, and whether it is of one part: whichever, and however far."""
        return type(self).__name__, self.part is None

    def _amounts(self, sizes: Array) -> Array:
        amounts: Array = self.amount**sizes if self.is_factor else self.amount * sizes
        return amounts

    @abstractmethod
    def _built(self, bodies: Bodies, amounts: Array) -> Bodies:
        """The bodies, each deviating by its own amount, shape (n,)."""


@dataclass(frozen=True, kw_only=True)
class Thickness(Deviation):
    """Parts of another thickness: a factor on their radii."""

    is_factor: ClassVar[bool] = True

    def _built(self, bodies: Bodies, amounts: Array) -> Bodies:
        return bodies.changed(radius=_times(bodies.radius, amounts, self.part))


@dataclass(frozen=True, kw_only=True)
class Travel(Deviation):
    """A factor on the angle by which servos turn."""

    is_factor: ClassVar[bool] = True

    def _built(self, bodies: Bodies, amounts: Array) -> Bodies:
        return bodies.changed(travel=_times(bodies.travel, amounts, self.part))


@dataclass(frozen=True, kw_only=True)
class TurnedHinge(Deviation):
    """The axis of one part's hinge turned about one of the part's own directions.

    Attributes:
        about: 0: along the part, 1: leftward, 2: upward in the planar pose.
    """

    part: int
    about: int

    def _built(self, bodies: Bodies, amounts: Array) -> Bodies:
        hinge = bodies.hinge.copy()
        axes = bodies.hinges[hinge[:, self.part]]
        one, two = (self.about + 1) % 3, (self.about + 2) % 3
        axes[:, [one, two]] = _turned(axes[:, [one, two]], amounts)
        hinge[:, self.part] = len(bodies.hinges) + np.arange(len(bodies))
        return bodies.changed(hinge=hinge, hinges=np.vstack([bodies.hinges, axes]))


@dataclass(frozen=True, kw_only=True)
class OffZero(Deviation):
    """A hinge whose zero differs from its servo's: a horn put on askew."""

    part: int

    def _built(self, bodies: Bodies, amounts: Array) -> Bodies:
        zero = bodies.zero.copy()
        zero[:, self.part] += amounts
        return bodies.changed(zero=zero)


@dataclass(frozen=True, kw_only=True)
class Density(Deviation):
    """Parts that are heavier or lighter for their size."""

    is_factor: ClassVar[bool] = True

    def _built(self, bodies: Bodies, amounts: Array) -> Bodies:
        return bodies.changed(density=_times(bodies.density, amounts, self.part))


@dataclass(frozen=True, kw_only=True)
class TiltGain(Deviation):
    """An accelerometer that makes more or less of tilt."""

    is_factor: ClassVar[bool] = True

    def _built(self, bodies: Bodies, amounts: Array) -> Bodies:
        base = bodies.base.copy()
        base[:, LEVEL] *= amounts[:, None]
        return bodies.changed(base=base)


@dataclass(frozen=True, kw_only=True)
class ShiftedFigure(Deviation):
    """A figure of ``Bodies.base`` to which something is added.

    Attributes:
        column: Of ``Bodies.base``.
    """

    column: int

    def _built(self, bodies: Bodies, amounts: Array) -> Bodies:
        base = bodies.base.copy()
        base[:, self.column] += amounts
        return bodies.changed(base=base)


class Askew(ShiftedFigure):
    """An accelerometer that is turned on the main body."""


class TooHigh(ShiftedFigure):
    """A distance sensor that reads too much or too little."""


@dataclass(frozen=True, kw_only=True)
class OffCentre(Deviation):
    """A main body whose mass is elsewhere than in its middle: a battery at one end.

    The amount is a share of the main body's extent along the axis.

    Attributes:
        axis: 0: forward, 1: leftward.
    """

    axis: int

    def _built(self, bodies: Bodies, amounts: Array) -> Bodies:
        base = bodies.base.copy()
        base[:, CENTRE + self.axis] += amounts * base[:, self.axis]
        return bodies.changed(base=base)


@dataclass(frozen=True, kw_only=True)
class TurnedMount(Deviation):
    """One part that points elsewhere from where it sits, leftward in the planar pose."""

    part: int

    def _built(self, bodies: Bodies, amounts: Array) -> Bodies:
        mount = bodies.mount.copy()
        on_base = bodies.parent[:, self.part] == BASE
        tables = []
        for table, here, yaw in (
            (bodies.base_mounts, on_base, BASE_YAW),
            (bodies.part_mounts, ~on_base, PART_YAW),
        ):
            rows = np.flatnonzero(here)
            own = table[mount[rows, self.part]]
            own[:, yaw] = _turned(own[:, yaw], amounts[rows])
            mount[rows, self.part] = len(table) + np.arange(rows.size)
            tables.append(np.vstack([table, own]))
        return bodies.changed(mount=mount, base_mounts=tables[0], part_mounts=tables[1])


@dataclass(frozen=True, kw_only=True)
class Limp(Deviation):
    """One part, and what it carries, hangs from a joint that its servo does not hold.

    Such parts support nothing, as if they had no length, and their ends lie on the ground.
    """

    is_factor: ClassVar[bool] = True  # once dead, always as dead

    part: int

    def _built(self, bodies: Bodies, amounts: Array) -> Bodies:
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
class Alternative:
    """An alternative hypothesis: a body that deviates from the problem, fitted to the readings.

    Attributes:
        deviation: How it does, and how far.
        point: Its genes, shape (size,).
        gains: How much better than the best body of the problem it explains each interaction,
            nats, shape (k,).
        log_share: Logarithm of the share of the sizes looked at that explain as much.
        log_prior: Logarithm of how probable its deviation was among all that are looked at.
    """

    deviation: Deviation
    point: Array
    gains: Array
    log_share: float = 0.0
    log_prior: float = 0.0

    @property
    def is_left(self) -> bool:
        """Whether it explains the readings about as well."""
        return bool(self.gains.sum() > -_WORSE)

    @property
    def gain(self) -> float:
        """How much better it explains them, on average over its sizes, nats."""
        return float(self.gains.sum() + self.log_share)

    @property
    def log_weight(self) -> float:
        """Logarithm of how probable it is by now, to a constant that all alternatives share."""
        return self.log_prior + self.gain

    @property
    def clear_gain(self) -> float:
        """``gain`` without the interaction that gains most: it may be an outlier."""
        return self.gain - float(self.gains.max())


def log_priors(deviations: Sequence[Deviation]) -> Array:
    """Logarithms of how probable deviations are before any reading, adding up to 1, shape (n,).

    Their families are as probable as each other, and so are the deviations of one family.
    """
    sizes = Counter(one.family for one in deviations)
    return -np.log([len(sizes) * sizes[one.family] for one in deviations])


class Deviations:
    """Several deviations, whose bodies are built kind by kind.

    Args:
        deviations: By number.
    """

    def __init__(self, deviations: Sequence[Deviation]) -> None:
        numbers: dict[Deviation, int] = {}
        self._kind = np.array(
            [numbers.setdefault(one.kind, len(numbers)) for one in deviations], dtype=np.intp
        )
        self._kinds = list(numbers)
        self._amount = np.array([one.amount for one in deviations])
        self._is_factor = np.array([one.is_factor for one in deviations])

    def of(self, bodies: Bodies, which: Integers, sizes: Array) -> Bodies:
        """Bodies of a problem, each built by one of the deviations.

        Args:
            bodies: n bodies.
            which: Number of the deviation of each, shape (n,).
            sizes: How far each deviates, shape (n,); see ``Deviation.of``.
        """
        amount, kind = self._amount[which], self._kind[which]
        powers = np.abs(amount) ** sizes  # factors are positive
        amounts = np.where(self._is_factor[which], powers, amount * sizes)
        groups = [np.flatnonzero(kind == number) for number in np.unique(kind)]
        built = [self._kinds[kind[rows[0]]]._built(bodies[rows], amounts[rows]) for rows in groups]
        return Bodies.joined(built)[np.argsort(np.concatenate(groups))]


def _times(values: Array, factors: Array, column: int | None) -> Array:
    """The values, shape (n, p), with one column or all times factors, shape (n,)."""
    scaled = values.copy()
    columns = slice(None) if column is None else slice(column, column + 1)
    scaled[:, columns] *= factors[:, None]
    return scaled


def _turned(vectors: Array, angles: Array) -> Array:
    """Vectors in a plane, shape (n, 2), each turned by its angle, rad."""
    (x, y), cosine, sine = vectors.T, np.cos(angles), np.sin(angles)
    return np.column_stack([cosine * x - sine * y, sine * x + cosine * y])


_THICKNESSES: Final = (0.35, 0.5, 0.7, 1.4, 2.0, 2.8)  # of all parts
_ONE_THICKNESS: Final = (0.5, 1.5, 2.5)
_TURNS: Final = (-30, -15, 15, 30)  # degrees
_OFFSETS: Final = (-12, -6, -3, 3, 6, 12)  # degrees
_HEAVIER: Final = (0.5, 2.0, 4.0)
_OFF_CENTRE: Final = (-0.25, -0.1, 0.1, 0.25)  # of the main body's extent
_ASKEW: Final = (-6, -2, 2, 6)  # degrees
_TRAVELS: Final = (0.8, 0.9, 1.1, 1.25)  # of all servos
_ONE_TRAVEL: Final = (0.6, 0.8, 1.25, 1.6)
_GAINS: Final = (0.8, 0.9, 1.1, 1.25)  # of the accelerometer
_TOO_MUCH: Final = (-10, -5, 5, 10)  # mm
_TOWARDS: Final = (("backward", "forward"), ("to the right", "to the left"))
_TILTS: Final = ("left/right", "forward/back")
_DIRECTIONS: Final = ("its own length", "the leftward direction", "the vertical")


class _Angle(TypedDict):
    amount: float
    unit: float


def possible_deviations(problem: Problem) -> tuple[Deviation, ...]:
    """Everything that is looked at.

    Parts of another thickness or mass, a main body that is heavier at one end, sensors that were
    put on askew or calibrated wrongly, servos that are dead, off their zero or turn by other angles
    than they are told, hinges and mounts turned by up to 30°. What the problem leaves open is no
    deviation.
    """
    left_open = problem.nuisance
    of_parts = (
        deviation
        for index, part in enumerate(problem.parts)
        for deviation in (
            *_of_a_part(part.name, index),
            *(() if part.motor is None else _of_a_servo(part.name, index, left_open)),
        )
    )
    return (*_of_all_parts(left_open), *_of_the_main_body(left_open), *of_parts)


def _of_all_parts(left_open: NuisanceSection) -> Iterator[Deviation]:
    for factor in _THICKNESSES:
        yield Thickness(text="parts {} times as thick", amount=factor)
    for factor in _HEAVIER if left_open.density is None else ():
        text = "parts {} times as heavy for their size"
        yield Density(text=text, amount=factor)
    for factor in _TRAVELS:
        yield Travel(text="all servos turning {} times as far as told", amount=factor)


def _of_the_main_body(left_open: NuisanceSection) -> Iterator[Deviation]:
    off_centre = _OFF_CENTRE if left_open.centre_of_mass_mm is None else ()
    askew = _ASKEW if left_open.accelerometer_deg is None else ()
    for axis, share in product((0, 1), off_centre):
        text = f"the main body's centre of mass {{}} % of its extent {_TOWARDS[axis][share > 0]}"
        yield OffCentre(text=text, axis=axis, amount=share, unit=100)
    for about, degrees in product((0, 1), askew):
        text = f"the accelerometer turned by {_minus(degrees)}{{}}° {_TILTS[about]}"
        yield Askew(text=text, column=ACCELEROMETER + about, **_angle(degrees))
    for factor in _GAINS:
        text = "an accelerometer that feels {} times the tilt"
        yield TiltGain(text=text, amount=factor)
    for offset in _TOO_MUCH:
        text = f"a distance sensor that reads {{}} mm too {'much' if offset > 0 else 'little'}"
        yield TooHigh(text=text, column=TOO_HIGH, amount=offset / 1000, unit=1000)


def _of_a_part(part: str, index: int) -> Iterator[Deviation]:
    for factor in _ONE_THICKNESS:
        yield Thickness(text=f"{part} {{}} times as thick", amount=factor, part=index)
    for degrees in _TURNS:
        side = "left" if degrees > 0 else "right"
        text = f"{part} pointing {{}}° {side} of its mount's direction"
        yield TurnedMount(text=text, part=index, **_angle(degrees))


def _of_a_servo(part: str, index: int, left_open: NuisanceSection) -> Iterator[Deviation]:
    yield Limp(text=f"the servo of {part} dead", part=index)
    for factor in _ONE_TRAVEL:
        text = f"the servo of {part} turning {{}} times as far as told"
        yield Travel(text=text, amount=factor, part=index)
    for degrees in _OFFSETS if left_open.joint_zero_deg is None else ():
        text = f"the zero of {part}'s servo off by {_minus(degrees)}{{}}°"
        yield OffZero(text=text, part=index, **_angle(degrees))
    for degrees, about in product(_TURNS, range(len(_DIRECTIONS))):
        sign, direction = _minus(degrees), _DIRECTIONS[about]
        text = f"the hinge of {part} turned by {sign}{{}}° about {direction}"
        yield TurnedHinge(text=text, part=index, about=about, **_angle(degrees))


def _minus(amount: float) -> str:
    return "-" if amount < 0 else ""


def _angle(degrees: float) -> _Angle:
    return {"amount": math.radians(degrees), "unit": math.degrees(1)}
