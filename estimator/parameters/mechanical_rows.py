"""Rows of the table of parameters for what a robot is built of: parts, main body, servos."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Final

import numpy as np

from estimator.body.arrays import BASE_YAW, CENTRE, PART_YAW
from estimator.body.morphology import BASE, Array
from estimator.parameters.rows import PartOutline
from estimator.parameters.table import MM, Draft, Parameter, scaled, scaling, shifted, switch, turn

STUB: Final = 0.02
"""Share of its length that a part keeps which hangs limply, or is gone."""

_MASS: Final = 3  # column of ``Bodies.base``
_AXES: Final = (
    ("its own length", "how the servo's axis lies along the leg"),
    ("the leftward direction", "whether the servo leans over"),
    ("the vertical", "whether the servo sits straight on its mount"),
)


# --- parts ------------------------------------------------------------------------------------


def of_parts(parts: Sequence[PartOutline], sensors: int) -> Iterator[Parameter]:
    """Rows for the thickness and mass of parts, and for how they are mounted."""
    all_parts = slice(None)
    yield scaling(
        name="thickness of all parts",
        group="thickness",
        change=partial(_thicker, all_parts),
        sentence="parts {} times as thick",
        check="measure a leg, and a foot, with a caliper",
        narrow=0.25,
        wide=0.7,
    )
    yield scaling(
        name="mass of all parts",
        group="mass",
        change=partial(_denser, all_parts),
        sentence="parts {} times as heavy",
        check="weigh a leg",
        narrow=1.0,
    )
    for index, part in enumerate(parts):
        name, column = part.name, slice(index, index + 1)
        yield scaling(
            name=f"thickness of {name}",
            group="thickness_of_each",
            change=partial(_thicker, column),
            sentence=f"{name}, or its foot, {{}} times as thick",
            check=f"measure {name} and its foot with a caliper",
            narrow=0.05,
            wide=0.7,
        )
        yield scaling(
            name=f"mass of {name}",
            group="mass_of_each",
            change=partial(_denser, column),
            sentence=f"{name} {{}} times as heavy",
            check=f"weigh {name}, and look for cables that pull at it",
            wide=1.0,
        )
        yield turn(
            name=f"direction of {name}",
            group="mount_deg",
            change=partial(_aside, index),
            sentence=f"{name} pointing {{}}° leftward of its mount's direction",
            check=f"look from above where {name} points",
            wide=math.radians(20.0),
        )
        if part.parent == BASE and part.mount is not None:
            yield Parameter(
                name=f"place of {name}",
                group="mount_mm",
                change=partial(_moved, index),
                sentence=f"{name} sitting {{}} mm leftward of its place, as it points",
                check=f"measure where {name} sits on the main body",
                unit=MM,
                wide=0.02,
                limit=0.08,
            )


def _thicker(columns: slice, draft: Draft, factors: Array) -> None:
    """Makes parts thicker, as heavy as before: else heavy and thick could hardly be told apart."""
    draft.measures("radius")[:, columns] *= factors[:, None]
    draft.measures("density")[:, columns] /= factors[:, None] ** 2


def _denser(columns: slice, draft: Draft, factors: Array) -> None:
    draft.measures("density")[:, columns] *= factors[:, None]


def _aside(part: int, draft: Draft, angles: Array) -> None:
    _remounted(part, draft, lambda own, yaw: _turn(own, yaw, angles))


def _moved(part: int, draft: Draft, ways: Array) -> None:
    """Moves a part along the side of the main body that it sits on: leftward, seen as it points."""

    def move(own: Array, yaw: slice) -> None:
        cosine, sine = own[:, yaw].T
        own[:, 0] -= ways * sine
        own[:, 1] += ways * cosine

    _remounted(part, draft, move)


def _remounted(part: int, draft: Draft, change: Callable[[Array, slice], None]) -> None:
    mounts = draft.numbers("mount")
    on_base = draft.numbers("parent")[:, part] == BASE
    for table, in_table, yaw in (
        ("base_mounts", on_base, BASE_YAW),
        ("part_mounts", ~on_base, PART_YAW),
    ):
        if not in_table.any():
            continue
        rows = draft.measures(table)[np.where(in_table, mounts[:, part], 0)]
        change(rows, yaw)
        numbers = draft.extended(table, rows)
        mounts[in_table, part] = numbers[in_table]


def _turn(vectors: Array, columns: slice | list[int], angles: Array) -> None:
    """Turns vectors within the plane of two columns, in place, each by its angle, rad."""
    (x, y), cosine, sine = vectors[:, columns].T, np.cos(angles), np.sin(angles)
    vectors[:, columns] = np.column_stack([cosine * x - sine * y, sine * x + cosine * y])


# --- the main body ----------------------------------------------------------------------------


def of_the_main_body(parts: Sequence[PartOutline], sensors: int) -> Iterator[Parameter]:
    """Rows for the main body's mass and centre of mass."""
    yield scaling(
        name="mass of the main body",
        group="main_mass",
        change=partial(scaled, _MASS),
        sentence="a main body {} times as heavy, or all parts as much lighter",
        check="weigh the main body with its battery",
        wide=0.7,
    )
    for axis, way in enumerate(("forward", "leftward", "upward")):
        yield Parameter(
            name=f"centre of mass, {way}",
            group="centre_of_mass_mm",
            change=partial(shifted, CENTRE + axis),
            sentence=f"the main body's centre of mass {{}} mm {way} of its middle",
            check="balance the main body on a ruler, and see where the battery sits",
            unit=MM,
            narrow=0.005,
            wide=0.03,
        )


# --- servos and hinges ------------------------------------------------------------------------


def of_servos(parts: Sequence[PartOutline], sensors: int) -> Iterator[Parameter]:
    """Rows for where servos stand at 0, how far they turn, about what, and whether they do."""
    yield scaling(
        name="travel of all servos",
        group="travel",
        change=partial(_farther, slice(None)),
        sentence="all servos turning {} times as far as told",
        check="calibrate the servos again",
        wide=0.2,
    )
    yield turn(
        name="where all servos stop",
        group="servo_short_deg",
        change=_short,
        sentence="all servos stopping {}° short of where they are told",
        check="move a leg by 30°, and hold a protractor to it",
        narrow=math.radians(1.0),
    )
    for index, part in enumerate(parts):
        if part.motor is None:
            continue
        name, column = part.name, slice(index, index + 1)
        yield turn(
            name=f"zero of {name}",
            group="zero_deg",
            change=partial(_off_zero, index),
            motor=part.motor,
            sentence=f"the zero of {name}'s servo off by {{}}°",
            check=f"send {name} to 0, and hold a protractor to it",
            narrow=math.radians(0.4),
            wide=math.radians(8.0),
            limit=math.radians(60.0),
        )
        yield scaling(
            name=f"travel of {name}",
            group="travel_of_each",
            change=partial(_farther, column),
            motor=part.motor,
            sentence=f"the servo of {name} turning {{}} times as far as told",
            check=f"move {name} by 30°, and hold a protractor to it",
            narrow=0.01,
            wide=0.3,
        )
        for axis, (about, look) in enumerate(_AXES):
            yield turn(
                name=f"hinge of {name} about {about}",
                group="hinge_deg",
                change=partial(_askew, index, axis),
                sentence=f"the hinge of {name} turned by {{}}° about {about}",
                check=f"look at {name}: {look}",
                wide=math.radians(20.0),
            )
        yield switch(
            name=f"servo of {name} dead",
            group="servo_dead",
            change=partial(_limp, index),
            sentence=f"the servo of {name} dead",
            check=f"take hold of {name}: a servo that works resists",
        )
        yield turn(
            name=f"servo of {name} jammed",
            group="servo_jammed",
            change=partial(_jammed, index),
            sentence=f"the servo of {name} standing still at {{}}°",
            check=f"watch {name} while it is moved",
            wide=math.radians(20.0),
            limit=math.radians(90.0),
            stops=index,
        )


def _farther(columns: slice, draft: Draft, factors: Array) -> None:
    draft.measures("travel")[:, columns] *= factors[:, None]


def _short(draft: Draft, angles: Array) -> None:
    draft.measures("short")[:] += angles[:, None]


def _off_zero(part: int, draft: Draft, angles: Array) -> None:
    draft.measures("zero")[:, part] += angles


def _askew(part: int, axis: int, draft: Draft, angles: Array) -> None:
    """Turns a hinge about one of the part's own axes: its length, leftward, and the vertical."""
    hinge = draft.numbers("hinge")
    axes = draft.measures("hinges")[hinge[:, part]]
    _turn(axes, [(axis + 1) % 3, (axis + 2) % 3], angles)
    hinge[:, part] = draft.extended("hinges", axes)


def _limp(part: int, draft: Draft, amounts: Array) -> None:
    """Lets a part hang with all it carries: it lies, and supports nothing, as if of no length."""
    parent = draft.numbers("parent")
    rows, hanging = np.arange(len(parent)), np.zeros(parent.shape, dtype=bool)
    hanging[:, part] = amounts > 0
    for column in range(part + 1, parent.shape[1]):  # a carrier comes before its parts
        carrier = parent[:, column]
        hanging[:, column] |= (carrier != BASE) & hanging[rows, carrier]
    draft.measures("length")[hanging] *= STUB
    draft.flags("limp")[hanging] = True


def _jammed(part: int, draft: Draft, angles: Array) -> None:
    jammed = angles != 0
    draft.measures("travel")[jammed, part] = 0.0
    draft.measures("zero")[jammed, part] = angles[jammed]
