"""Many bodies as arrays, for back-ends that need no object per body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from estimator.body.morphology import BASE, HINGES, SIDES, Array, Morphology
from estimator.errors import MorphologyError

Integers: TypeAlias = NDArray[np.int64]

_NONE = -1
_NUMBERS = ("parent", "side", "hinge", "motor", "sensor")
_LARGEST = 1e6
"""Of any extent (m), mass (kg) or density (kg/m³): beyond it arithmetic cannot be trusted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bodies:
    """n bodies of at most p parts; row i of every array is body i, column j is its part j.

    What each means is written in ``Morphology``, ``Base`` and ``Part``.

    Attributes:
        count: Parts of each body, shape (n,); columns beyond are not looked at.
        parent: Shape (n, p), and so on; −1 is the main body.
        side: Index into ``SIDES``.
        hinge: Index into ``HINGES``.
        motor: −1 where the hinge is locked.
        sensor: −1 where there is none.
        length: m.
        radius: m.
        base: Shape (n, 5): extent of the main body along x, y and z, m, its mass, kg, and the
            density of the parts, kg/m³.

    Raises:
        MorphologyError: A body cannot exist.
    """

    count: Integers
    parent: Integers
    side: Integers
    hinge: Integers
    motor: Integers
    sensor: Integers
    length: Array
    radius: Array
    base: Array

    def __post_init__(self) -> None:
        rows, columns = self.parent.shape
        for item in fields(self):
            array = getattr(self, item.name)
            kind = np.dtype(float if item.name in ("length", "radius", "base") else np.int64)
            shape = {"count": (rows,), "base": (rows, 5)}.get(item.name, (rows, columns))
            if array.shape != shape or array.dtype != kind:
                raise MorphologyError(
                    f"{item.name} of {rows} bodies of {columns} parts must be {kind} of shape "
                    f"{shape}, not {array.dtype} of shape {array.shape}"
                )
            object.__setattr__(self, item.name, np.ascontiguousarray(array))
        used = np.arange(columns) < self.count[:, None]
        earlier = np.arange(columns)[None, :]
        _check(self.count, (self.count >= 0) & (self.count <= columns), "number of parts")
        for name, possible in (
            ("parent", (self.parent >= BASE) & (self.parent < earlier)),
            ("side", (self.side >= 0) & (self.side < len(SIDES))),
            ("hinge", (self.hinge >= 0) & (self.hinge < len(HINGES))),
            ("motor", self.motor >= _NONE),
            ("sensor", self.sensor >= _NONE),
            ("length", (self.length >= 0) & (self.length <= _LARGEST)),
            ("radius", (self.radius > 0) & (self.radius <= _LARGEST)),
        ):
            _check(getattr(self, name), possible | ~used, name)
        _check(self.base, (self.base > 0) & (self.base <= _LARGEST), "main body or density")

    def __len__(self) -> int:
        return len(self.count)

    def __getitem__(self, rows: slice | NDArray[np.intp] | NDArray[np.bool_]) -> Bodies:
        """Some of the bodies."""
        chosen = object.__new__(Bodies)  # rows of checked arrays need no new check
        for item in fields(self):
            array = np.ascontiguousarray(getattr(self, item.name)[rows])
            object.__setattr__(chosen, item.name, array)
        return chosen

    @property
    def motors(self) -> int:
        """How many angles a motor program for these bodies must hold at least."""
        return self._most(self.motor)

    @property
    def sensors(self) -> int:
        """How many touch sensors the bodies have, at most."""
        return self._most(self.sensor)

    def _most(self, numbers: Integers) -> int:
        used = np.arange(numbers.shape[1]) < self.count[:, None]
        return int(np.max(np.where(used, numbers, _NONE), initial=_NONE)) + 1

    @classmethod
    def of(cls, morphologies: Sequence[Morphology]) -> Bodies:
        """The same bodies as arrays."""
        count = np.array([len(body.parts) for body in morphologies], dtype=np.int64)
        shape = (len(count), int(count.max(initial=0)))
        numbers = {name: np.full(shape, _NONE, dtype=np.int64) for name in _NUMBERS}
        length, radius = np.zeros(shape), np.zeros(shape)
        base = np.empty((len(count), 5))
        for row, body in enumerate(morphologies):
            base[row] = *body.base.size, body.base.mass, body.density
            for column, part in enumerate(body.parts):
                length[row, column], radius[row, column] = part.length, part.radius
                for name, values in numbers.items():
                    value = getattr(part, name)
                    values[row, column] = _NONE if value is None else value
        return cls(count=count, length=length, radius=radius, base=base, **numbers)


def _check(values: Array | Integers, possible: NDArray[np.bool_], name: str) -> None:
    if not possible.all():
        where = np.argwhere(~possible)[0]
        part = f", part {where[1] + 1}" if len(where) > 1 and name != "main body or density" else ""
        raise MorphologyError(
            f"body {where[0] + 1}{part}: its {name} cannot be {values[tuple(where)]}"
        )
