"""Readings as a table that a person can write: ``readings.csv``.

One row per interaction, in degrees and millimetres::

    angle_deg_<joint>   one column per joint, in motor order: the angle commanded
    touch_1, touch_2 …  1 where the sensor felt the ground, else 0
    tilt_lr_deg         left/right tilt, left side up is positive
    tilt_fb_deg         forward/back tilt, nose up is positive
    clearance_mm        belly to ground along the belly's normal

An empty cell is a reading that was not taken; a missing column is one that never was. Other columns
are refused, since a misspelt one would silently count as missing.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from estimator.errors import ReadingsError
from estimator.readings.observation import Observation
from protocol.wire.field_checks import MAX_ITEMS

ANGLE: Final = "angle_deg_"
TOUCH: Final = "touch_"
TILT: Final = ("tilt_lr_deg", "tilt_fb_deg")
CLEARANCE: Final = "clearance_mm"
_COLUMNS: Final = 2 * MAX_ITEMS + len(TILT) + 1


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table of readings.

    Attributes:
        joints: Names of the joints that have a column, in column order.
        touch_sensors: Number of touch columns.
        has_tilt: Whether there is a column of either tilt.
        has_clearance: Whether there is a clearance column.
        observations: The rows; ``angles`` is in the order of ``joints``.
    """

    joints: tuple[str, ...]
    touch_sensors: int
    has_tilt: bool
    has_clearance: bool
    observations: tuple[Observation, ...]


def write(path: Path, joints: Sequence[str], observations: Sequence[Observation]) -> None:
    """Writes observations whose ``angles`` are in the order of ``joints``."""
    sensors = max((len(item.touch) for item in observations), default=0)
    touch = [f"{TOUCH}{number}" for number in range(1, sensors + 1)]
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow([*(f"{ANGLE}{joint}" for joint in joints), *touch, *TILT, CLEARANCE])
        for item in observations:
            bits = ["" if bit is None else int(bit) for bit in item.touch]
            clearance = "" if item.clearance is None else f"{item.clearance * 1000:.4f}"
            rows.writerow(
                [*map(_degrees, item.angles), *bits, *map(_degrees, item.tilt), clearance]
            )


def read(path: Path) -> Table:
    """Reads a table.

    Raises:
        ReadingsError: The file cannot be read, or a column or cell is wrong; the message names it.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            header, *rows = [row for row in csv.reader(file, strict=True) if any(row)]
    except OSError as error:
        raise ReadingsError(f"{path} cannot be read: {error.strerror}.") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise ReadingsError(f"{path} is no table of comma-separated values: {error}.") from error
    except ValueError:
        raise ReadingsError(f"{path} is empty: write a header and a row per interaction.") from None
    header = [name.strip() for name in header]
    if len(header) > _COLUMNS:
        raise ReadingsError(
            f"{path} has {len(header)} columns, and a robot has at most {MAX_ITEMS} joints and "
            f"{MAX_ITEMS} touch sensors."
        )
    joints = tuple(name.removeprefix(ANGLE) for name in header if name.startswith(ANGLE))
    sensors = sum(name.startswith(TOUCH) for name in header)
    _check_header(path, header, sensors)
    if not rows:
        raise ReadingsError(f"{path} has no rows: write one per interaction.")
    return Table(
        joints=joints,
        touch_sensors=sensors,
        has_tilt=any(name in header for name in TILT),
        has_clearance=CLEARANCE in header,
        observations=tuple(
            _observation(f"{path}, row {number}", header, row) for number, row in enumerate(rows, 1)
        ),
    )


def _check_header(path: Path, header: list[str], sensors: int) -> None:
    touch = [f"{TOUCH}{number}" for number in range(1, sensors + 1)]
    for name in header:
        known = name.startswith(ANGLE) and name != ANGLE
        if not known and name not in (*touch, *TILT, CLEARANCE):
            raise ReadingsError(
                f"{path}: there is no column {name!r}. Columns are {ANGLE}<joint>, {TOUCH}1 "
                f"to {TOUCH}n, {', '.join(TILT)} and {CLEARANCE}."
            )
        if header.count(name) > 1:
            raise ReadingsError(f"{path}: the column {name!r} stands there twice.")
    if not any(name.startswith(ANGLE) for name in header):
        raise ReadingsError(f"{path}: no column says what was commanded; write {ANGLE}<joint>.")
    if len(header) == sum(name.startswith(ANGLE) for name in header):
        raise ReadingsError(f"{path}: no column says what was felt; write {TOUCH}1, {TILT[0]}, …")


def _observation(where: str, header: list[str], row: list[str]) -> Observation:
    if len(row) != len(header):
        raise ReadingsError(f"{where}: has {len(row)} cells, and the header has {len(header)}.")
    cells = dict(zip(header, row, strict=True))
    angles: list[float] = []
    touch: list[bool | None] = []
    for name, cell in cells.items():
        if name.startswith(ANGLE):
            angle = _number(where, name, cell, -180.0, 180.0)
            if angle is None:
                raise ReadingsError(f"{where}: {name} is empty; write the angle commanded.")
            angles.append(math.radians(angle))
    for number in range(1, sum(name.startswith(TOUCH) for name in header) + 1):
        cell = cells[f"{TOUCH}{number}"].strip()
        if cell not in ("", "0", "1"):
            raise ReadingsError(f"{where}: {TOUCH}{number} must be 0, 1 or empty, not {cell!r}.")
        touch.append(bool(int(cell)) if cell else None)
    lr, fb = (_number(where, name, cells.get(name, ""), -90.0, 90.0) for name in TILT)
    clearance = _number(where, CLEARANCE, cells.get(CLEARANCE, ""), -100.0, 10_000.0)
    return Observation(
        angles=tuple(angles),
        touch=tuple(touch),
        tilt=(lr and math.radians(lr), fb and math.radians(fb)),
        clearance=clearance and clearance / 1000,
    )


def _number(where: str, name: str, cell: str, least: float, largest: float) -> float | None:
    text = cell.strip()
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        raise ReadingsError(f"{where}: {name} must be a number or empty, not {text!r}.") from None
    if not least <= value <= largest:  # also refuses NaN
        raise ReadingsError(f"{where}: {name} must lie in {least:g} to {largest:g}, not {text}.")
    return value


def _degrees(angle: float | None) -> str:
    return "" if angle is None else f"{math.degrees(angle):.4f}"
