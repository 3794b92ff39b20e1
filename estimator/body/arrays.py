"""Many bodies as arrays, for back-ends that need no object per body."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Final, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from estimator.body.morphology import BASE, Array, Base, Morphology, Part
from estimator.body.mounts import BaseMount, Hinge, PartMount, heading
from estimator.errors import MorphologyError

Integers: TypeAlias = NDArray[np.int64]
Flags: TypeAlias = NDArray[np.bool_]

_Entry = TypeVar("_Entry")

CENTRE: Final = 4
"""First column of the centre of mass in ``Bodies.base``; the next constants are columns, too."""

ACCELEROMETER: Final = 7  # the first of two
LEVEL: Final = slice(9, 13)
TOO_HIGH: Final = 13
DISTANCE_GAIN: Final = 14
ROUND: Final = 15

BASE_YAW: Final = slice(3, 5)  # columns of ``Bodies.base_mounts``: cosine and sine of the yaw
PART_YAW: Final = slice(1, 3)  # the same of ``Bodies.part_mounts``

_NONE = -1
_NUMBERS = ("parent", "mount", "hinge", "motor", "sensor")
_TABLES = {"base_mounts": 7, "part_mounts": 5, "hinges": 3}  # number of columns
_BASE_COLUMNS = 16
_TRUE_SENSORS = (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
_MEASURES = {"length", "radius", "density", "zero", "travel", "short", "base", *_TABLES}
_FLAGS = {"box", "limp"}
_LARGEST = 1e6
"""Largest extent (m), mass (kg) or density (kg/m³): beyond it arithmetic cannot be trusted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bodies:
    """n bodies of at most p parts; row i of every array is body i, column j is its part j.

    ``Morphology``, ``Base`` and ``Part`` say more about what each array holds.

    Attributes:
        count: Number of parts of each body, shape (n,); columns beyond it are ignored.
        parent: Index of each part's parent; −1: the main body. Shape (n, p), like all arrays from
            here to ``short``.
        mount: Row of ``base_mounts`` for parts on the main body, of ``part_mounts`` for others.
        hinge: Row of ``hinges``.
        motor: Index of the motor; −1 where the hinge is locked.
        sensor: Index of the touch sensor; −1 where there is none.
        length: Length of the part, m.
        radius: Radius, or half the width of a box, m.
        density: Density of the part, kg/m³.
        box: Whether the part is a box; else it is a capsule.
        zero: Angle of the hinge where the motor stands at 0, rad.
        limp: Whether the part hangs from a joint that nothing holds, or from such a part: then its
            sensor reads contact in every pose, whatever a back-end says.
        stuck: What the part's touch sensor reads in every pose: 1 contact, −1 no contact; 0: the
            sensor is not stuck.
        travel: How far the motor turns the hinge, as a factor on the command.
        short: Angle by which the motor stops short of that, on its way from 0, rad; below 0: turns
            farther.
        base: Shape (n, 16): extent of the main body along x, y and z, m, its mass, kg, its centre
            of mass, m, and how its accelerometer is turned about x and y, rad; then the errors of
            its sensors: the 2×2 matrix, row by row, from gravity leftward and forward to what the
            accelerometer shows of them, the offset of the clearance, m, and its gain; and 1 where
            the main body is round, else 0.
        base_mounts: Mounts on main bodies, of all bodies together, one a row: x, y, z, m, then
            cosine and sine of the yaw, and of the elevation.
        part_mounts: Mounts on parts, one a row: fraction of the carrier's length, then cosine and
            sine of the yaw, and of the elevation.
        hinges: Axes of hinges, one a row.

    Raises:
        MorphologyError: A body cannot exist.
    """

    count: Integers
    parent: Integers
    mount: Integers
    hinge: Integers
    motor: Integers
    sensor: Integers
    length: Array
    radius: Array
    density: Array
    box: Flags
    zero: Array
    limp: Flags
    stuck: Integers
    travel: Array
    short: Array
    base: Array
    base_mounts: Array
    part_mounts: Array
    hinges: Array

    def __post_init__(self) -> None:
        rows, columns = self.parent.shape
        for field in fields(self):
            array = getattr(self, field.name)
            kind = np.dtype(
                float if field.name in _MEASURES else bool if field.name in _FLAGS else np.int64
            )
            body_shape = {"count": (rows,), "base": (rows, _BASE_COLUMNS)}.get(
                field.name, (rows, columns)
            )
            shape = (len(array), _TABLES[field.name]) if field.name in _TABLES else body_shape
            if array.shape != shape or array.dtype != kind:
                raise MorphologyError(
                    f"{field.name} of {rows} bodies of {columns} parts must be {kind} of shape "
                    f"{shape}, not {array.dtype} of shape {array.shape}"
                )
            object.__setattr__(self, field.name, np.ascontiguousarray(array))
        on_base = self.parent == BASE
        mounts = np.where(on_base, len(self.base_mounts), len(self.part_mounts))
        is_part, part_indices = self._is_part, np.arange(columns)[None, :]
        _check(self.count, (self.count >= 0) & (self.count <= columns), "number of parts")
        for name, possible in (
            ("parent", (self.parent >= BASE) & (self.parent < part_indices)),
            ("mount", (self.mount >= 0) & (self.mount < mounts)),
            ("hinge", (self.hinge >= 0) & (self.hinge < len(self.hinges))),
            ("motor", self.motor >= _NONE),
            ("sensor", self.sensor >= _NONE),
            ("length", (self.length >= 0) & (self.length <= _LARGEST)),
            ("radius", (self.radius > 0) & (self.radius <= _LARGEST)),
            ("density", (self.density > 0) & (self.density <= _LARGEST)),
            ("zero", np.isfinite(self.zero)),
        ):
            _check(getattr(self, name), possible | ~is_part, name)
        sizes, signed = self.base[:, :CENTRE], self.base[:, CENTRE:]
        _check(sizes, (sizes > 0) & (sizes <= _LARGEST), "main body")
        _check(signed, np.abs(signed) <= _LARGEST, "centre of mass, accelerometer or sensors")

    def __len__(self) -> int:
        _, rows = self.origin
        return len(rows)

    def __getitem__(self, rows: slice | NDArray[np.intp] | Flags) -> Bodies:
        """Returns some of the bodies; an array is copied only when it is first looked at."""
        source, source_rows = self.origin
        chosen = object.__new__(Bodies)  # rows of checked arrays need no new check
        chosen.__dict__.update({name: getattr(source, name) for name in _SHARED_ARRAYS})
        chosen.__dict__["_origin"] = source, np.ascontiguousarray(source_rows[rows])
        return chosen

    if not TYPE_CHECKING:  # so that type checkers report misspelt attributes

        def __getattr__(self, name: str) -> Array | Integers | Flags:
            if name not in _PER_BODY_ARRAYS:
                raise AttributeError(f"bodies have no {name}")
            source, rows = self.origin
            array = getattr(source, name).take(rows, axis=0)  # several times as fast as an index
            self.__dict__[name] = array
            return array

    @property
    def origin(self) -> tuple[Bodies, NDArray[np.intp]]:
        """Bodies that these were chosen from (or these), and rows of these there, shape (n,)."""
        chosen: tuple[Bodies, NDArray[np.intp]] | None = self.__dict__.get("_origin")
        return (self, np.arange(len(self.count))) if chosen is None else chosen

    def objects(self) -> list[Morphology]:
        """The bodies as objects, without what motors and sensors make of commands and poses."""
        return [self._object(row) for row in range(len(self))]

    def _object(self, row: int) -> Morphology:
        base_mounts, part_mounts, hinges, parts = [], [], [], []
        for column in range(int(self.count[row])):
            mount, name = int(self.mount[row, column]), str(column + 1)
            on_base = self.parent[row, column] == BASE
            table = self.base_mounts if on_base else self.part_mounts
            *at, east, north, level, rise = table[mount].tolist()
            direction = {"yaw": math.atan2(north, east), "elevation": math.atan2(rise, level)}
            if on_base:
                base_mounts.append(BaseMount(name=name, at=(at[0], at[1], at[2]), **direction))
            else:
                part_mounts.append(PartMount(name=name, fraction=at[0], **direction))
            x, y, z = self.hinges[self.hinge[row, column]].tolist()
            hinges.append(Hinge(name=name, axis=(x, y, z)))
            motor, sensor = int(self.motor[row, column]), int(self.sensor[row, column])
            parts.append(
                Part(
                    parent=int(self.parent[row, column]),
                    mount=len(base_mounts if on_base else part_mounts) - 1,
                    hinge=column,
                    length=float(self.length[row, column]),
                    radius=float(self.radius[row, column]),
                    motor=None if motor == _NONE else motor,
                    sensor=None if sensor == _NONE else sensor,
                    zero=float(self.zero[row, column]),
                    shape="box" if self.box[row, column] else "capsule",
                    density=float(self.density[row, column]),
                )
            )
        x, y, z, mass, *rest = self.base[row].tolist()
        return Morphology(
            base=Base(
                size=(x, y, z),
                mass=mass,
                mounts=tuple(base_mounts),
                centre=(rest[0], rest[1], rest[2]),
                accelerometer=(rest[3], rest[4]),
                round=bool(self.base[row, ROUND]),
            ),
            parts=tuple(parts),
            density=1.0,
            part_mounts=tuple(part_mounts),
            hinges=tuple(hinges),
        )

    def changed(self, **arrays: Array | Integers | Flags) -> Bodies:
        """Returns these bodies with some arrays replaced, by name; new arrays are not checked."""
        changed = object.__new__(Bodies)
        changed.__dict__.update(
            {name: np.ascontiguousarray(array) for name, array in arrays.items()}
        )
        derived = [name for name, sources in _DERIVED.items() if sources.isdisjoint(arrays)]
        unchanged = (name for name in (*_ARRAYS, *derived) if name not in arrays)
        changed.__dict__.update({name: getattr(self, name) for name in unchanged})
        return changed

    @classmethod
    def joined(cls, several: Sequence[Bodies]) -> Bodies:
        """Joins bodies of equally many columns, in the order given."""
        arrays = {
            item.name: [getattr(bodies, item.name) for bodies in several] for item in fields(cls)
        }
        on_base = [bodies.parent == BASE for bodies in several]
        for name, tables in (
            ("mount", ("base_mounts", "part_mounts")),
            ("hinge", ("hinges", "hinges")),
        ):
            starts = [np.cumsum([0, *map(len, arrays[table])]) for table in tables]
            arrays[name] = [
                numbers + np.where(mask, starts[0][index], starts[1][index])
                for index, (numbers, mask) in enumerate(zip(arrays[name], on_base, strict=True))
            ]
        return cls(**{name: np.concatenate(values) for name, values in arrays.items()})

    @cached_property
    def motors(self) -> int:
        """Number of angles in a motor program for these bodies, or all they were chosen from."""
        return self._largest_count(self.motor)

    @cached_property
    def sensors(self) -> int:
        """Largest number of touch sensors of these bodies, or of all that they were chosen from."""
        return self._largest_count(self.sensor)

    @cached_property
    def strays(self) -> tuple[float, float, float]:
        """Largest absolute value of ``travel``, of ``zero``, rad, and of ``short``, rad.

        Of these bodies, or of all that they were chosen from.
        """
        travel, zero, short = (
            float(np.max(np.abs(array), where=self._is_part, initial=0.0))
            for array in (self.travel, self.zero, self.short)
        )
        return travel, zero, short

    @cached_property
    def odd_sensors(self) -> tuple[bool, bool, bool]:
        """Whether some body's sensors err in tilt, in clearance and in touch.

        Of these bodies, or of all that they were chosen from; see ``base``, ``limp`` and ``stuck``.
        """
        odd = np.any(self.base[:, LEVEL.start : ROUND] != _TRUE_SENSORS, axis=0).tolist()
        return any(odd[:-2]), any(odd[-2:]), bool(self.limp.any() or self.stuck.any())

    @property
    def _is_part(self) -> Flags:
        return np.arange(self.parent.shape[1]) < self.count[:, None]

    def _largest_count(self, numbers: Integers) -> int:
        return int(np.max(numbers, where=self._is_part, initial=_NONE)) + 1

    @classmethod
    def of(cls, morphologies: Sequence[Morphology]) -> Bodies:
        """Makes arrays of bodies that are given as objects."""
        count = np.array([len(body.parts) for body in morphologies], dtype=np.int64)
        shape = (len(count), int(count.max(initial=0)))
        numbers = {name: np.full(shape, _NONE, dtype=np.int64) for name in _NUMBERS}
        length, radius, density, zero = (np.zeros(shape) for _ in range(4))
        box = np.zeros(shape, dtype=bool)
        base = np.empty((len(count), _BASE_COLUMNS))
        base[:, LEVEL.start : ROUND] = _TRUE_SENSORS
        base_mounts, part_mounts, hinges = _Rows(7), _Rows(5), _Rows(3)
        for row, body in enumerate(morphologies):
            main = body.base
            base[row, : LEVEL.start] = *main.size, main.mass, *main.centre, *main.accelerometer
            base[row, ROUND] = main.round
            density[row] = body.density
            on_base = base_mounts.start(
                body.base.mounts,
                lambda mount: (*mount.at, *heading(mount.yaw), *heading(mount.elevation)),
            )
            on_part = part_mounts.start(
                body.part_mounts,
                lambda mount: (mount.fraction, *heading(mount.yaw), *heading(mount.elevation)),
            )
            hinge = hinges.start(body.hinges, lambda hinge: hinge.axis)
            for column, part in enumerate(body.parts):
                length[row, column], radius[row, column] = part.length, part.radius
                zero[row, column], box[row, column] = part.zero, part.shape == "box"
                density[row, column] = body.density if part.density is None else part.density
                for name, array in numbers.items():
                    number = getattr(part, name)
                    array[row, column] = _NONE if number is None else number
                numbers["mount"][row, column] += on_base if part.parent == BASE else on_part
                numbers["hinge"][row, column] += hinge
        return cls(
            count=count,
            length=length,
            radius=radius,
            density=density,
            box=box,
            zero=zero,
            limp=np.zeros(shape, dtype=bool),
            stuck=np.zeros(shape, dtype=np.int64),
            travel=np.ones(shape),
            short=np.zeros(shape),
            base=base,
            base_mounts=base_mounts.array(),
            part_mounts=part_mounts.array(),
            hinges=hinges.array(),
            **numbers,
        )


_ARRAYS: Final = tuple(item.name for item in fields(Bodies))
_PER_BODY_ARRAYS: Final = frozenset(
    name for name in _ARRAYS if name not in _TABLES
)  # a row per body
_DERIVED: Final = {
    "motors": {"count", "motor"},
    "sensors": {"count", "sensor"},
    "strays": {"count", "travel", "zero", "short"},
    "odd_sensors": {"base", "limp", "stuck"},
}
_SHARED_ARRAYS: Final = (*_TABLES, *_DERIVED)  # by bodies and those chosen from them


class _Rows:
    """The tables of several bodies one below the other; a table that bodies share is there once."""

    def __init__(self, columns: int) -> None:
        self._columns = columns
        self._starts: dict[int, int] = {}
        self._rows: list[tuple[float, ...]] = []

    def start(
        self, table: tuple[_Entry, ...], row_of: Callable[[_Entry], tuple[float, ...]]
    ) -> int:
        """Returns the first row of a table, which is added if it is new."""
        if id(table) not in self._starts:  # the bodies keep their tables alive
            self._starts[id(table)] = len(self._rows)
            self._rows += map(row_of, table)
        return self._starts[id(table)]

    def array(self) -> Array:
        return np.array(self._rows, dtype=float).reshape(-1, self._columns)


def _check(values: Array | Integers, possible: Flags, name: str) -> None:
    if not possible.all():
        index = np.argwhere(~possible)[0]
        part = f", part {index[1] + 1}" if name in _PER_BODY_ARRAYS else ""
        raise MorphologyError(
            f"body {index[0] + 1}{part}: its {name} cannot be {values[tuple(index)]}"
        )
