"""The table: what robots have otherwise than their problems say, and by how much.

Narrow spreads are those of robots as people build them, wide ones what is noticed only by moving.
What feels the same has one row, whose sentence names both: ground that slopes and an accelerometer
that is turned, a foot and the part that it is on. A row more is one entry here and a test of what
it does; a package adds some by the entry-point group ``bodyschema.parameters``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import combinations
from typing import Final, Protocol, TypeAlias

import numpy as np

from estimator.body.arrays import (
    ACCELEROMETER,
    BASE_YAW,
    CENTRE,
    DISTANCE_GAIN,
    LEVEL,
    PART_YAW,
    TOO_HIGH,
)
from estimator.body.morphology import BASE, Array
from estimator.parameters.table import Draft, Parameter
from estimator.plugins import Registry

_STUB: Final = 0.02  # of the length of a part that hangs limply
_MASS: Final = 3  # column of ``Bodies.base``

_DEGREES: Final = math.degrees(1.0)
_MM: Final = 1000.0
_LIMIT: Final = math.log(12.0)  # of factors
_FARTHEST_TURN: Final = math.radians(40.0)  # beyond it a hinge is another hinge
_AXES: Final = (
    ("its own length", "how the servo's axis lies along the leg"),
    ("the leftward direction", "whether the servo leans over"),
    ("the vertical", "whether the servo sits straight on its mount"),
)


class PartOutline(Protocol):
    """What the table must know of a part; ``None`` stands for what is to be found."""

    @property
    def name(self) -> str:
        """For people."""

    @property
    def parent(self) -> int | None:
        """What it sits on."""

    @property
    def mount(self) -> str | None:
        """Where."""

    @property
    def hinge(self) -> str | None:
        """How its hinge turns it."""

    @property
    def motor(self) -> int | None:
        """The motor that drives it; ``None``: none does."""

    @property
    def sensor(self) -> int | None:
        """The touch sensor that it has."""

    @property
    def radius(self) -> float:
        """Half of its thickness, m."""

    @property
    def shape(self) -> str:
        """``capsule`` or ``box``."""

    @property
    def length(self) -> tuple[float, float]:
        """Its length, m: the least and the most."""


RowSource: TypeAlias = Callable[[Sequence[PartOutline], int], Iterable[Parameter]]
"""Rows for a robot with these parts and so many touch sensors."""

SOURCES: Final = Registry[RowSource](
    kind="table of parameters",
    group="bodyschema.parameters",
    own={
        "parts": "estimator.parameters.rows:of_parts",
        "main-body": "estimator.parameters.rows:of_the_main_body",
        "sensors": "estimator.parameters.rows:of_sensors",
        "servos": "estimator.parameters.rows:of_servos",
        "wiring": "estimator.parameters.rows:of_wiring",
    },
)


def table_of(parts: Sequence[PartOutline], sensors: int) -> tuple[Parameter, ...]:
    """All rows for a robot with these parts and so many touch sensors."""
    return tuple(row for name in SOURCES.names() for row in SOURCES.load(name)(parts, sensors))


def packages() -> dict[str, str]:
    """Version by name of the packages that add rows."""
    return {
        package: version
        for name in SOURCES.names()
        for package, version in SOURCES.package(name).items()
    }


# --- parts ------------------------------------------------------------------------------------


def of_parts(parts: Sequence[PartOutline], sensors: int) -> Iterator[Parameter]:
    """Thickness, mass, and how parts are put on."""
    every = slice(None)
    yield Parameter(
        name="thickness of all parts",
        group="thickness",
        belongs_to="robot",
        change=partial(_thicker, every),
        sentence="parts {} times as thick",
        check="measure a leg, and a foot, with a caliper",
        factor=True,
        narrow=0.25,
        wide=0.7,
        limit=_LIMIT,
    )
    yield Parameter(
        name="mass of all parts",
        group="mass",
        belongs_to="robot",
        change=partial(_denser, every),
        sentence="parts {} times as heavy",
        check="weigh a leg",
        factor=True,
        narrow=1.0,
        limit=_LIMIT,
    )
    for index, part in enumerate(parts):
        name, own = part.name, slice(index, index + 1)
        yield Parameter(
            name=f"thickness of {name}",
            group="thickness_of_each",
            belongs_to="part",
            change=partial(_thicker, own),
            sentence=f"{name}, or its foot, {{}} times as thick",
            check=f"measure {name} and its foot with a caliper",
            factor=True,
            narrow=0.05,
            wide=0.7,
            limit=_LIMIT,
        )
        yield Parameter(
            name=f"mass of {name}",
            group="mass_of_each",
            belongs_to="part",
            change=partial(_denser, own),
            sentence=f"{name} {{}} times as heavy",
            check=f"weigh {name}, and look for cables that pull at it",
            factor=True,
            wide=1.0,
            limit=_LIMIT,
        )
        yield Parameter(
            name=f"direction of {name}",
            group="mount_deg",
            belongs_to="part",
            change=partial(_aside, index),
            sentence=f"{name} pointing {{}}° leftward of its mount's direction",
            check=f"look from above where {name} points",
            unit=_DEGREES,
            wide=math.radians(20.0),
            limit=_FARTHEST_TURN,
        )
        if part.parent == BASE and part.mount is not None:
            yield Parameter(
                name=f"place of {name}",
                group="mount_mm",
                belongs_to="part",
                change=partial(_moved, index),
                sentence=f"{name} sitting {{}} mm leftward of its place, as it points",
                check=f"measure where {name} sits on the main body",
                unit=_MM,
                wide=0.02,
                limit=0.08,
            )


def _thicker(columns: slice, draft: Draft, factors: Array) -> None:
    """Of as much mass: or a heavy part and a thick one could hardly be told apart."""
    draft.measures("radius")[:, columns] *= factors[:, None]
    draft.measures("density")[:, columns] /= factors[:, None] ** 2


def _denser(columns: slice, draft: Draft, factors: Array) -> None:
    draft.measures("density")[:, columns] *= factors[:, None]


def _aside(part: int, draft: Draft, angles: Array) -> None:
    _remounted(part, draft, lambda own, yaw: _turn(own, yaw, angles))


def _moved(part: int, draft: Draft, ways: Array) -> None:
    """Along the side of the main body that it sits on: leftward, seen as it points."""

    def move(own: Array, yaw: slice) -> None:
        cosine, sine = own[:, yaw].T
        own[:, 0] -= ways * sine
        own[:, 1] += ways * cosine

    _remounted(part, draft, move)


def _remounted(part: int, draft: Draft, change: Callable[[Array, slice], None]) -> None:
    mounts = draft.numbers("mount")
    on_base = draft.numbers("parent")[:, part] == BASE
    for table, here, yaw in (
        ("base_mounts", on_base, BASE_YAW),
        ("part_mounts", ~on_base, PART_YAW),
    ):
        if not here.any():
            continue
        own = draft.measures(table)[np.where(here, mounts[:, part], 0)]
        change(own, yaw)
        numbers = draft.extended(table, own)
        mounts[here, part] = numbers[here]


def _turn(vectors: Array, columns: slice | list[int], angles: Array) -> None:
    """Turns vectors within the plane of two columns, in place, each by its angle, rad."""
    (x, y), cosine, sine = vectors[:, columns].T, np.cos(angles), np.sin(angles)
    vectors[:, columns] = np.column_stack([cosine * x - sine * y, sine * x + cosine * y])


# --- the main body ----------------------------------------------------------------------------


def of_the_main_body(parts: Sequence[PartOutline], sensors: int) -> Iterator[Parameter]:
    """Its mass, and where that is."""
    yield Parameter(
        name="mass of the main body",
        group="main_mass",
        belongs_to="robot",
        change=partial(_scaled, _MASS),
        sentence="a main body {} times as heavy, or all parts as much lighter",
        check="weigh the main body with its battery",
        factor=True,
        wide=0.7,
        limit=_LIMIT,
    )
    for axis, way in enumerate(("forward", "leftward", "upward")):
        yield Parameter(
            name=f"centre of mass, {way}",
            group="centre_of_mass_mm",
            belongs_to="robot",
            change=partial(_shifted, CENTRE + axis),
            sentence=f"the main body's centre of mass {{}} mm {way} of its middle",
            check="balance the main body on a ruler, and see where the battery sits",
            unit=_MM,
            narrow=0.005,
            wide=0.03,
        )


def _scaled(column: int, draft: Draft, factors: Array) -> None:
    draft.measures("base")[:, column] *= factors


def _shifted(column: int, draft: Draft, amounts: Array) -> None:
    draft.measures("base")[:, column] += amounts


# --- sensors ----------------------------------------------------------------------------------

_QUARTER_TURNS: Final = {
    "accelerometer by a quarter turn leftward": (0.0, -1.0, 1.0, 0.0),
    "accelerometer by a quarter turn rightward": (0.0, 1.0, -1.0, 0.0),
    "accelerometer by half a turn": (-1.0, 0.0, 0.0, -1.0),
    "accelerometer's axes exchanged": (0.0, 1.0, 1.0, 0.0),
    "left/right tilt reversed": (-1.0, 0.0, 0.0, 1.0),
    "forward/back tilt reversed": (1.0, 0.0, 0.0, -1.0),
}
"""What they make of gravity leftward and forward, row by row."""


def of_sensors(parts: Sequence[PartOutline], sensors: int) -> Iterator[Parameter]:
    """How they were put on, and calibrated."""
    for axis, (way, rises) in enumerate((("left/right", "left"), ("forward/back", "front"))):
        yield Parameter(
            name=f"accelerometer's own tilt, {way}",
            group="accelerometer_deg",
            belongs_to="sensor",
            change=partial(_shifted, ACCELEROMETER + axis),
            sentence=f"an accelerometer turned by {{}}° {way}, or ground that rises so to the "
            f"{rises}",
            check="put a spirit level on the ground and on the main body",
            unit=_DEGREES,
            narrow=math.radians(0.4),
            wide=math.radians(6.0),
            limit=_FARTHEST_TURN,
        )
    yield Parameter(
        name="accelerometer's turn about the vertical",
        group="accelerometer_yaw_deg",
        belongs_to="sensor",
        change=_level_turned,
        sentence="an accelerometer turned by {}° leftward about the vertical",
        check="look from above how the accelerometer's board lies",
        unit=_DEGREES,
        narrow=math.radians(0.4),
        wide=math.radians(15.0),
        limit=math.radians(60.0),
    )
    yield Parameter(
        name="accelerometer's gain",
        group="accelerometer_gain",
        belongs_to="sensor",
        change=_level_scaled,
        sentence="an accelerometer that feels {} times gravity",
        check="calibrate the accelerometer again",
        factor=True,
        narrow=0.01,
        wide=0.2,
        limit=_LIMIT,
    )
    yield Parameter(
        name="distance sensor's offset",
        group="distance_mm",
        belongs_to="sensor",
        change=partial(_shifted, TOO_HIGH),
        sentence="a distance sensor that reads {} mm too much",
        check="hold a ruler to the belly while the robot reads its distance",
        unit=_MM,
        narrow=0.002,
        wide=0.008,
    )
    yield Parameter(
        name="distance sensor's gain",
        group="distance_gain",
        belongs_to="sensor",
        change=partial(_scaled, DISTANCE_GAIN),
        sentence="a distance sensor that reads {} times the distance",
        check="hold a ruler to the belly at two heights",
        factor=True,
        narrow=0.01,
        wide=0.2,
        limit=_LIMIT,
    )
    known = all(part.parent is not None and part.mount is not None for part in parts)
    for name, matrix in _QUARTER_TURNS.items() if known else ():  # else bodies are turned as well
        yield Parameter(
            name=name,
            group="accelerometer_wiring",
            belongs_to="sensor",
            change=partial(_rewired, matrix),
            sentence=f"the {name}" if name.startswith("accel") else name,
            check="tilt the robot by hand, and watch which tilt changes, and its sign",
            switch=True,
        )
    for gauge in range(sensors):
        for name, reads, group in (("dead", -1, "gauge_dead"), ("stuck on", 1, "gauge_stuck")):
            yield Parameter(
                name=f"touch sensor {gauge + 1} {name}",
                group=group,
                belongs_to="sensor",
                change=partial(_stuck, gauge, reads),
                sentence=f"touch sensor {gauge + 1} {name}",
                check=f"press touch sensor {gauge + 1} by hand, and watch its bit",
                switch=True,
            )


def _level_turned(draft: Draft, angles: Array) -> None:
    """Rows are what is felt leftward and forward of a board that is turned leftward."""
    base, cosine, sine = draft.measures("base"), np.cos(angles), np.sin(angles)
    turn = np.stack([cosine, -sine, sine, cosine], axis=1)
    base[:, LEVEL] = _product(turn, base[:, LEVEL])


def _level_scaled(draft: Draft, factors: Array) -> None:
    draft.measures("base")[:, LEVEL] *= factors[:, None]


def _rewired(matrix: Sequence[float], draft: Draft, amounts: Array) -> None:
    base, on = draft.measures("base"), amounts > 0
    base[on, LEVEL] = _product(np.array(matrix)[None], base[on, LEVEL])


def _product(ones: Array, others: Array) -> Array:
    """Of matrices of two rows, each as four numbers."""
    return (ones.reshape(-1, 2, 2) @ others.reshape(-1, 2, 2)).reshape(-1, 4)


def _stuck(gauge: int, reads: int, draft: Draft, amounts: Array) -> None:
    own = (draft.numbers("sensor") == gauge) & (amounts > 0)[:, None]
    draft.numbers("stuck")[own] = reads


# --- servos and hinges ------------------------------------------------------------------------


def of_servos(parts: Sequence[PartOutline], sensors: int) -> Iterator[Parameter]:
    """Where they stand at 0, how far they turn, about what, and whether they do."""
    yield Parameter(
        name="travel of all servos",
        group="travel",
        belongs_to="joint",
        change=partial(_farther, slice(None)),
        sentence="all servos turning {} times as far as told",
        check="calibrate the servos again",
        factor=True,
        wide=0.2,
        limit=_LIMIT,
    )
    for index, part in enumerate(parts):
        if part.motor is None:
            continue
        name, own = part.name, slice(index, index + 1)
        yield Parameter(
            name=f"zero of {name}",
            group="zero_deg",
            belongs_to="joint",
            change=partial(_off_zero, index),
            motor=part.motor,
            sentence=f"the zero of {name}'s servo off by {{}}°",
            check=f"send {name} to 0, and hold a protractor to it",
            unit=_DEGREES,
            narrow=math.radians(0.4),
            wide=math.radians(8.0),
            limit=math.radians(60.0),
        )
        yield Parameter(
            name=f"travel of {name}",
            group="travel_of_each",
            belongs_to="joint",
            change=partial(_farther, own),
            motor=part.motor,
            sentence=f"the servo of {name} turning {{}} times as far as told",
            check=f"move {name} by 30°, and hold a protractor to it",
            factor=True,
            narrow=0.01,
            wide=0.3,
            limit=_LIMIT,
        )
        for axis, (about, look) in enumerate(_AXES):
            yield Parameter(
                name=f"hinge of {name} about {about}",
                group="hinge_deg",
                belongs_to="joint",
                change=partial(_askew, index, axis),
                sentence=f"the hinge of {name} turned by {{}}° about {about}",
                check=f"look at {name}: {look}",
                unit=_DEGREES,
                wide=math.radians(20.0),
                limit=_FARTHEST_TURN,
            )
        yield Parameter(
            name=f"servo of {name} dead",
            group="servo_dead",
            belongs_to="joint",
            change=partial(_limp, index),
            sentence=f"the servo of {name} dead",
            check=f"take hold of {name}: a servo that works resists",
            switch=True,
        )
        yield Parameter(
            name=f"servo of {name} jammed",
            group="servo_jammed",
            belongs_to="joint",
            change=partial(_jammed, index),
            sentence=f"the servo of {name} standing still at {{}}°",
            check=f"watch {name} while it is moved",
            unit=_DEGREES,
            wide=math.radians(20.0),
            limit=math.radians(90.0),
        )


def _farther(columns: slice, draft: Draft, factors: Array) -> None:
    draft.measures("travel")[:, columns] *= factors[:, None]


def _off_zero(part: int, draft: Draft, angles: Array) -> None:
    draft.measures("zero")[:, part] += angles


def _askew(part: int, axis: int, draft: Draft, angles: Array) -> None:
    """About one of the part's own directions: its length, leftward, and the vertical."""
    hinge = draft.numbers("hinge")
    own = draft.measures("hinges")[hinge[:, part]]
    _turn(own, [(axis + 1) % 3, (axis + 2) % 3], angles)
    hinge[:, part] = draft.extended("hinges", own)


def _limp(part: int, draft: Draft, amounts: Array) -> None:
    """It hangs with what it carries: supports nothing, as if it had no length, and lies down."""
    parent = draft.numbers("parent")
    rows, hanging = np.arange(len(parent)), np.zeros(parent.shape, dtype=bool)
    hanging[:, part] = amounts > 0
    for column in range(part + 1, parent.shape[1]):  # a carrier comes before its parts
        carrier = parent[:, column]
        hanging[:, column] |= (carrier != BASE) & hanging[rows, carrier]
    draft.measures("length")[hanging] *= _STUB
    draft.flags("limp")[hanging] = True


def _jammed(part: int, draft: Draft, angles: Array) -> None:
    still = angles != 0
    draft.measures("travel")[still, part] = 0.0
    draft.measures("zero")[still, part] = angles[still]


# --- wiring -----------------------------------------------------------------------------------


def of_wiring(parts: Sequence[PartOutline], sensors: int) -> Iterator[Parameter]:
    """Directions and plugs; where mounts and hinges are to be found they are found with these."""
    driven = [(index, part) for index, part in enumerate(parts) if part.motor is not None]
    for index, part in driven:
        if part.hinge is not None:
            yield Parameter(
                name=f"servo of {part.name} reversed",
                group="servo_reversed",
                belongs_to="joint",
                change=partial(_reversed, index),
                sentence=f"the servo of {part.name} turning the other way",
                check=f"send {part.name} to +20°, and see which way it goes",
                switch=True,
            )
    for (one, first), (other, second) in combinations(driven, 2):
        if None not in (first.mount, first.hinge, second.mount, second.hinge):
            yield Parameter(
                name=f"plugs of {first.name} and {second.name} exchanged",
                group="servo_plugs",
                belongs_to="joint",
                change=partial(_exchanged, one, other),
                sentence=f"the servo plugs of {first.name} and {second.name} exchanged",
                check=f"move {first.name} alone, and see which leg moves",
                switch=True,
            )
    known_by_gauge = {
        part.sensor: (part.parent, part.radius, part.shape, part.length)
        for part in parts
        if part.motor is None and part.mount is None
    }
    for first_gauge, second_gauge in combinations(range(sensors), 2):
        alike = known_by_gauge.get(first_gauge)
        if alike and alike == known_by_gauge.get(second_gauge):
            continue  # it is found as if the parts themselves were exchanged
        yield Parameter(
            name=f"plugs of touch sensors {first_gauge + 1} and {second_gauge + 1} exchanged",
            group="gauge_plugs",
            belongs_to="sensor",
            change=partial(_gauges_exchanged, first_gauge, second_gauge),
            sentence=f"the plugs of touch sensors {first_gauge + 1} and {second_gauge + 1} "
            "exchanged",
            check=f"press touch sensor {first_gauge + 1}, and watch which bit changes",
            switch=True,
        )


def _reversed(part: int, draft: Draft, amounts: Array) -> None:
    draft.measures("travel")[amounts > 0, part] *= -1.0


def _exchanged(one: int, other: int, draft: Draft, amounts: Array) -> None:
    motor, on = draft.numbers("motor"), np.flatnonzero(amounts > 0)
    motor[on, one], motor[on, other] = motor[on, other], motor[on, one]


def _gauges_exchanged(one: int, other: int, draft: Draft, amounts: Array) -> None:
    sensor, on = draft.numbers("sensor"), (amounts > 0)[:, None]
    first, second = (sensor == one) & on, (sensor == other) & on
    sensor[first], sensor[second] = other, one
