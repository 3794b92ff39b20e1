"""A parameter of a robot: how far it may be from what is stated, and what that changes.

Its *narrow* component is how far robots stray unnoticed, and is always open: a normal distribution
around what the problem states. Its *wide* one is a robot that is not as stated at all, and has a
probability (``MISWIRED`` for wiring, ``DEVIATES`` for all other parameters together), or one that
has changed in use. ``rows`` has the table.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Bodies, Flags, Integers
from estimator.body.morphology import Array

DEVIATES: Final = 0.05
"""Probability, before any reading, that a robot has one of the wide components, but for wiring."""

MISWIRED: Final = 0.05
"""Probability, before any reading, that a robot whose mounts and hinges are known is miswired."""

WIRING: Final = frozenset({"servo_reversed", "servo_plugs", "gauge_plugs", "accelerometer_wiring"})
"""Groups of what is plugged in, or put on, the wrong way round."""

MEDIAN_CARE: Final = 1.4
"""Median of the log-normal factor that the narrow spreads of all that care decides share."""

CARE: Final = 0.6
"""Standard deviation of that factor's logarithm: of one robot in four the factor is 2 or more, of
one in 25 a half or less."""

DEGREES: Final = math.degrees(1.0)
"""Factor on an amount in radians for a sentence, in degrees."""

MM: Final = 1000.0
"""Factor on an amount in metres for a sentence, in millimetres."""

LARGEST_FACTOR: Final = math.log(12.0)
"""Logarithm of the largest factor."""

FARTHEST_TURN: Final = math.radians(40.0)
"""Limit of turns, rad: beyond it a hinge is another hinge."""

_UNNOTICED: Final = 4.0  # narrow standard deviations; what is farther off is wide
_CARELESSLY: Final = 2.0  # factor on ``_UNNOTICED`` where care decides the spread
_STATED: Final = frozenset({"thickness", "mass"})  # what robots are built of: no matter of care


class Draft:
    """Bodies that are being changed: each array is copied when first asked for.

    Args:
        bodies: The bodies, which are left as they are.
    """

    def __init__(self, bodies: Bodies) -> None:
        self._bodies = bodies
        self._changed: dict[str, Array | Integers | Flags] = {}

    def __len__(self) -> int:
        return len(self._bodies)

    def measures(self, name: str) -> Array:
        """One of the arrays of numbers, to be changed in place."""
        return self._array(name)

    def numbers(self, name: str) -> Integers:
        """One of the arrays of integers, to be changed in place."""
        return self._array(name)

    def flags(self, name: str) -> Flags:
        """One of the arrays of flags, to be changed in place."""
        return self._array(name)

    def extended(self, table: str, rows: Array) -> Integers:
        """Adds rows to a table of mounts or hinges; returns their numbers, shape (rows,)."""
        existing = self._array(table)
        self._changed[table] = np.vstack([existing, rows])
        return len(existing) + np.arange(len(rows))

    def done(self) -> Bodies:
        """The bodies with all changes."""
        return self._bodies.changed(**self._changed) if self._changed else self._bodies

    def _array(self, name: str) -> np.ndarray:
        if name not in self._changed:
            self._changed[name] = getattr(self._bodies, name).copy()
        return self._changed[name]


def scaled(column: int, draft: Draft, factors: Array) -> None:
    """Multiplies a column of ``Bodies.base``."""
    draft.measures("base")[:, column] *= factors


def shifted(column: int, draft: Draft, amounts: Array) -> None:
    """Adds to a column of ``Bodies.base``."""
    draft.measures("base")[:, column] += amounts


Change: TypeAlias = Callable[[Draft, Array], None]
"""Changes n bodies, each by its own amount, shape (n,); an amount of 0, or a factor of 1, changes
nothing. Must be picklable, for worker processes."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A row of the table: one thing that may be otherwise.

    Attributes:
        name: Name for people, unique in the table.
        group: Group that it belongs to: a problem's ``[uncertain]`` says how well one is known.
        change: Changes bodies by amounts of it.
        sentence: For people, as the rest of "a robot with …"; braces stand for the amount.
        check: What a person can check by hand.
        factor: Whether amounts are factors, and spreads those of their logarithms.
        switch: Whether it either is so, 1, or is not, 0, without an amount.
        unit: Factor from SI units to those of the amount in the sentence.
        narrow: Standard deviation of robots as people build them; 0: as stated.
        wide: Standard deviation of a robot that is not as stated; 0: there is none.
        limit: Largest amount, of a factor its logarithm, in either direction.
        motor: Motor of the joint whose calibration says how narrow it is; ``None``: no joint's
            does.
        stops: Index of the part that no longer turns on its hinge because of it, if any: on another
            hinge the part would stand still elsewhere.
    """

    name: str
    group: str
    change: Change
    sentence: str
    check: str
    factor: bool = False
    switch: bool = False
    unit: float = 1.0
    narrow: float = 0.0
    wide: float = 0.0
    limit: float = math.inf
    motor: int | None = None
    stops: int | None = None

    @property
    def may_deviate(self) -> bool:
        """Whether it has a wide component."""
        return self.wide > 0 or self.switch

    @property
    def is_centred(self) -> bool:
        """Whether amounts lie around what is stated, the farther off the less probable."""
        return not self.switch

    @property
    def by_care(self) -> bool:
        """Whether its narrow component is the wider the less carefully a robot is built."""
        return self.narrow > 0 and self.group not in _STATED

    def amounts(self, spread: float, theta: Array) -> Array:
        """Amounts that are ``theta`` times ``spread`` off what is stated.

        Factors, or in SI units; 1 for a switch.
        """
        if self.switch:
            return np.ones_like(theta)
        off = np.minimum(np.maximum(spread * theta, -self.limit), self.limit)  # clip takes longer
        return np.exp(off) if self.factor else off

    def as_told(self, amounts: Array) -> Array:
        """The amounts as people are told of them, shape (n,)."""
        return amounts

    def applied(self, bodies: Bodies, amounts: Array | float = 1.0) -> Bodies:
        """The bodies, each changed by its own amount, shape (n,), or all by one."""
        draft = Draft(bodies)
        self.change(draft, np.broadcast_to(np.asarray(amounts, dtype=float), len(bodies)))
        return draft.done()

    def said(self, amount: float, interval: tuple[float, float] | None = None) -> str:
        """The sentence with an amount and, where it is given, an interval that holds it."""
        if self.switch:
            return self.sentence
        words = self.sentence.replace("{}", self._in_words(amount))
        if interval is None:
            return words
        return f"{words} [{'–'.join(map(self._in_words, interval))}]"

    def _in_words(self, amount: float) -> str:
        shown = amount * self.unit
        digits = max(0, 1 - math.floor(math.log10(abs(shown)))) if shown else 0
        return f"{shown:{'' if self.factor else '+'}.{min(digits, 3)}f}"


scaling = partial(Parameter, factor=True, limit=LARGEST_FACTOR)
"""Makes a row whose amounts are factors."""

turn = partial(Parameter, unit=DEGREES, limit=FARTHEST_TURN)
"""Makes a row whose amounts are turns."""

switch = partial(Parameter, switch=True)
"""Makes a row of what either is so or is not."""


def applied(table: Sequence[Parameter], bodies: Bodies, deviations: Array) -> Bodies:
    """Bodies with the deviations that columns of a posterior hold.

    Args:
        table: The rows that columns stand for.
        bodies: n bodies, as stated.
        deviations: Deviations of each body from what is stated, shape (n, rows): in SI units, of
            factors their logarithms, of switches 1; 0: as stated.
    """
    draft, used = Draft(bodies), np.flatnonzero(np.any(deviations != 0, axis=0)).tolist()
    rows = [table[column] for column in used]
    limits = np.array([[row.limit] for row in rows]).reshape(-1, 1)
    amounts = np.minimum(np.maximum(deviations.T[used], -limits), limits)  # of all at once: faster
    for row, amount in zip(rows, amounts, strict=True):
        row.change(draft, np.exp(amount) if row.factor else amount)
    return draft.done()


def prior_probabilities(table: Sequence[Parameter]) -> Array:
    """Probability of each wide component before any reading, and last that there is none.

    Wiring is what builders get wrong most often, so its groups have ``MISWIRED`` to themselves, and
    all others ``DEVIATES``. A group of wiring has its share whether or not the others are open:
    where mounts and hinges are to be found, they have the rest. Groups of a kind are as probable as
    each other, and so are the parameters of a group: that a builder was wrong about how thick parts
    are is not a hundred times less probable because there are so many hinges.

    Returns:
        Probabilities, shape (rows + 1,); 0 where a row has no wide component.
    """
    sizes = Counter(row.group for row in table if row.may_deviate)
    groups = len(sizes.keys() - WIRING)
    of_rows = [
        (MISWIRED / len(WIRING) if row.group in WIRING else DEVIATES / groups) / sizes[row.group]
        if row.may_deviate
        else 0.0
        for row in table
    ]
    return np.array([*of_rows, 1 - sum(of_rows)])


def deviating(table: Sequence[Parameter], deviations: Array) -> NDArray[np.int64]:
    """The row whose wide component each of n bodies has, shape (n,); −1: it has none.

    Args:
        table: The rows.
        deviations: Deviations of the bodies from what is stated, shape (n, rows); see ``applied``.
    """
    least = [
        _UNNOTICED * row.narrow * (_CARELESSLY if row.by_care else 1.0)
        if row.may_deviate
        else math.inf
        for row in table
    ]
    far = np.abs(deviations) > least
    return np.where(far.any(axis=1), far.argmax(axis=1), -1) if table else np.full(len(far), -1)
