"""Rows of the table of parameters for sensors, and for how servos and sensors are plugged in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations
from typing import Final

import numpy as np

from estimator.body.arrays import ACCELEROMETER, DISTANCE_GAIN, LEVEL, TOO_HIGH
from estimator.body.morphology import Array
from estimator.parameters.rows import PartOutline
from estimator.parameters.table import MM, Draft, Parameter, scaled, scaling, shifted, switch, turn

# --- sensors ----------------------------------------------------------------------------------

_QUARTER_TURNS: Final = {
    "accelerometer by a quarter turn leftward": (0.0, -1.0, 1.0, 0.0),
    "accelerometer by a quarter turn rightward": (0.0, 1.0, -1.0, 0.0),
    "accelerometer by half a turn": (-1.0, 0.0, 0.0, -1.0),
    "accelerometer's axes exchanged": (0.0, 1.0, 1.0, 0.0),
    "left/right tilt reversed": (-1.0, 0.0, 0.0, 1.0),
    "forward/back tilt reversed": (1.0, 0.0, 0.0, -1.0),
}
"""What each makes of gravity leftward and forward: a 2×2 matrix, row by row."""


def of_sensors(parts: Sequence[PartOutline], sensors: int) -> Iterator[Parameter]:
    """Rows for how sensors were mounted and calibrated, and for those that fail."""
    for axis, (way, rises) in enumerate((("left/right", "left"), ("forward/back", "front"))):
        yield turn(
            name=f"accelerometer's own tilt, {way}",
            group="accelerometer_deg",
            change=partial(shifted, ACCELEROMETER + axis),
            sentence=f"an accelerometer turned by {{}}° {way}, or ground that rises so to the "
            f"{rises}",
            check="put a spirit level on the ground and on the main body",
            narrow=math.radians(0.4),
            wide=math.radians(6.0),
        )
    yield turn(
        name="accelerometer's turn about the vertical",
        group="accelerometer_yaw_deg",
        change=_level_turned,
        sentence="an accelerometer turned by {}° leftward about the vertical",
        check="look from above how the accelerometer's board lies",
        narrow=math.radians(0.4),
        wide=math.radians(15.0),
        limit=math.radians(60.0),
    )
    yield scaling(
        name="accelerometer's gain",
        group="accelerometer_gain",
        change=_level_scaled,
        sentence="an accelerometer that feels {} times gravity",
        check="calibrate the accelerometer again",
        narrow=0.01,
        wide=0.2,
    )
    yield Parameter(
        name="distance sensor's offset",
        group="distance_mm",
        change=partial(shifted, TOO_HIGH),
        sentence="a distance sensor that reads {} mm too much",
        check="hold a ruler to the belly while the robot reads its distance",
        unit=MM,
        narrow=0.002,
        wide=0.008,
    )
    yield scaling(
        name="distance sensor's gain",
        group="distance_gain",
        change=partial(scaled, DISTANCE_GAIN),
        sentence="a distance sensor that reads {} times the distance",
        check="hold a ruler to the belly at two heights",
        narrow=0.01,
        wide=0.2,
    )
    # Where parents or mounts are to be found, bodies are found turned as well.
    mounts_known = all(part.parent is not None and part.mount is not None for part in parts)
    for name, matrix in _QUARTER_TURNS.items() if mounts_known else ():
        yield switch(
            name=name,
            group="accelerometer_wiring",
            change=partial(_rewired, matrix),
            sentence=f"the {name}" if name.startswith("accel") else name,
            check="tilt the robot by hand, and watch which tilt changes, and its sign",
        )
    for gauge in range(sensors):
        for name, reads, group in (("dead", -1, "gauge_dead"), ("stuck on", 1, "gauge_stuck")):
            yield switch(
                name=f"touch sensor {gauge + 1} {name}",
                group=group,
                change=partial(_stuck, gauge, reads),
                sentence=f"touch sensor {gauge + 1} {name}",
                check=f"press touch sensor {gauge + 1} by hand, and watch its bit",
            )


def _level_turned(draft: Draft, angles: Array) -> None:
    """Turns accelerometers leftward; rows of ``turn`` are what they feel leftward and forward."""
    base, cosine, sine = draft.measures("base"), np.cos(angles), np.sin(angles)
    turn = np.stack([cosine, -sine, sine, cosine], axis=1)
    base[:, LEVEL] = _product(turn, base[:, LEVEL])


def _level_scaled(draft: Draft, factors: Array) -> None:
    draft.measures("base")[:, LEVEL] *= factors[:, None]


def _rewired(matrix: Sequence[float], draft: Draft, amounts: Array) -> None:
    base, rows = draft.measures("base"), amounts > 0
    base[rows, LEVEL] = _product(np.array(matrix)[None], base[rows, LEVEL])


def _product(ones: Array, others: Array) -> Array:
    """Products of 2×2 matrices, each given as four numbers."""
    return (ones.reshape(-1, 2, 2) @ others.reshape(-1, 2, 2)).reshape(-1, 4)


def _stuck(gauge: int, reads: int, draft: Draft, amounts: Array) -> None:
    is_stuck = (draft.numbers("sensor") == gauge) & (amounts > 0)[:, None]
    draft.numbers("stuck")[is_stuck] = reads


# --- wiring -----------------------------------------------------------------------------------


def of_wiring(parts: Sequence[PartOutline], sensors: int) -> Iterator[Parameter]:
    """Rows for directions and plugs, except where they are found with unknown mounts and hinges."""
    driven = [(index, part) for index, part in enumerate(parts) if part.motor is not None]
    for index, part in driven:
        if part.hinge is not None:
            yield switch(
                name=f"servo of {part.name} reversed",
                group="servo_reversed",
                change=partial(_reversed, index),
                sentence=f"the servo of {part.name} turning the other way",
                check=f"send {part.name} to +20°, and see which way it goes",
            )
    for (first_index, first), (second_index, second) in combinations(driven, 2):
        if None not in (first.mount, first.hinge, second.mount, second.hinge):
            yield switch(
                name=f"plugs of {first.name} and {second.name} exchanged",
                group="servo_plugs",
                change=partial(_exchanged, first_index, second_index),
                sentence=f"the servo plugs of {first.name} and {second.name} exchanged",
                check=f"move {first.name} alone, and see which leg moves",
            )
    known_by_gauge = {
        part.sensor: (part.parent, part.radius, part.shape, part.length)
        for part in parts
        if part.motor is None and part.mount is None
    }
    for first_gauge, second_gauge in combinations(range(sensors), 2):
        known = known_by_gauge.get(first_gauge)
        if known and known == known_by_gauge.get(second_gauge):
            continue  # it is found as if the parts themselves were exchanged
        yield switch(
            name=f"plugs of touch sensors {first_gauge + 1} and {second_gauge + 1} exchanged",
            group="gauge_plugs",
            change=partial(_gauges_exchanged, first_gauge, second_gauge),
            sentence=f"the plugs of touch sensors {first_gauge + 1} and {second_gauge + 1} "
            "exchanged",
            check=f"press touch sensor {first_gauge + 1}, and watch which bit changes",
        )


def _reversed(part: int, draft: Draft, amounts: Array) -> None:
    draft.measures("travel")[amounts > 0, part] *= -1.0


def _exchanged(one: int, other: int, draft: Draft, amounts: Array) -> None:
    motor, rows = draft.numbers("motor"), np.flatnonzero(amounts > 0)
    motor[rows, one], motor[rows, other] = motor[rows, other], motor[rows, one]


def _gauges_exchanged(one: int, other: int, draft: Draft, amounts: Array) -> None:
    sensor, rows = draft.numbers("sensor"), (amounts > 0)[:, None]
    first, second = (sensor == one) & rows, (sensor == other) & rows
    sensor[first], sensor[second] = other, one
