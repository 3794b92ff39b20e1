"""Readings as a table that a person can write: ``readings.csv``.

One row per interaction, in degrees and millimetres::

    angle_deg_<joint>   one column per joint, in motor order: the angle measured, or commanded
    touch_1, touch_2 …  1 where the part met the ground, else 0
    tilt_lr_deg         left/right tilt, left side up is positive
    tilt_fb_deg         forward/back tilt, nose up is positive
    clearance_mm        belly to ground along the belly's normal

An empty cell is a reading that was not taken; a missing column is one that never was. Other columns
are refused, since a misspelt one would silently count as missing.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Final

from estimator.errors import ReadingsError
from estimator.readings.modalities import MODALITIES, parse_number
from estimator.readings.observation import Observation
from protocol.wire.field_checks import MAX_ITEMS

ANGLE: Final = "angle_deg_"
_COLUMNS: Final = MAX_ITEMS + sum(
    MAX_ITEMS if modality.on_parts else len(modality.columns(1)) for modality in MODALITIES.values()
)


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table of readings.

    Attributes:
        joints: Names of the joints that have a column, in column order.
        counts: How many values of each modality a row has, by the modality's name.
        observations: The rows; ``angles`` is in the order of ``joints``.
    """

    joints: tuple[str, ...]
    counts: Mapping[str, int]
    observations: tuple[Observation, ...]


def write(path: Path, joints: Sequence[str], observations: Sequence[Observation]) -> None:
    """Writes observations, ``angles`` in the order of ``joints``: as measured, else commanded."""
    modalities = MODALITIES.values()
    header = [f"{ANGLE}{joint}" for joint in joints]
    for modality in modalities:
        count = max((len(modality.values(item)) for item in observations), default=0)
        header += modality.columns(count)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        for item in observations:
            angles = [f"{math.degrees(angle):.4f}" for angle in item.taken]
            cells = [
                modality.cell(value) for modality in modalities for value in modality.values(item)
            ]
            writer.writerow([*angles, *cells])


def read(path: Path) -> Table:
    """Reads a table.

    Raises:
        ReadingsError: The file cannot be read, or a column or cell is wrong; the message names it.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise ReadingsError(f"{path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise ReadingsError(
            f"{path} is no table in UTF-8: {error.reason}. Save it as CSV UTF-8."
        ) from error
    _check_separator(path, text)
    try:
        rows = [row for row in csv.reader(io.StringIO(text, newline=""), strict=True) if any(row)]
    except csv.Error as error:
        raise ReadingsError(f"{path} is no table of comma-separated values: {error}.") from error
    if not rows:
        raise ReadingsError(f"{path} is empty: write a header and a row per interaction.")
    header, *rows = rows
    header = [name.strip() for name in header]
    if len(header) > _COLUMNS:
        raise ReadingsError(
            f"{path} has {len(header)} columns, and a robot has at most {MAX_ITEMS} joints and "
            f"{MAX_ITEMS} touch sensors."
        )
    joints = tuple(name.removeprefix(ANGLE) for name in header if name.startswith(ANGLE))
    counts = {name: modality.count(header) for name, modality in MODALITIES.items()}
    columns = {name: modality.columns(counts[name]) for name, modality in MODALITIES.items()}
    _check_header(path, header, columns)
    if not rows:
        raise ReadingsError(f"{path} has no rows: write one per interaction.")
    return Table(
        joints=joints,
        counts=counts,
        observations=tuple(
            _observation(f"{path}, row {number}", header, row, columns)
            for number, row in enumerate(rows, 1)
        ),
    )


def _check_separator(path: Path, text: str) -> None:
    """Refuses separators that a spreadsheet writes where commas stand in numbers."""
    header = text.lstrip("\r\n").partition("\n")[0].strip()
    known = [column for modality in MODALITIES.values() for column in modality.columns(MAX_ITEMS)]
    for separator, words in ((";", "';'"), ("\t", "tabs"), ("|", "'|'")):
        _, *columns = (column.strip().strip('"') for column in header.split(separator))
        if header == f"sep={separator}" or any(
            column.startswith(ANGLE) or column in known for column in columns
        ):
            raise ReadingsError(
                f"{path}: its columns are separated by {words}: save it with commas, and points in "
                "numbers."
            )


def _check_header(path: Path, header: list[str], columns: Mapping[str, Sequence[str]]) -> None:
    known_columns = [column for group in columns.values() for column in group]
    for name in header:
        is_angle = name.startswith(ANGLE) and name != ANGLE
        if not is_angle and name not in known_columns:
            raise ReadingsError(
                f"{path}: there is no column {name!r}. Columns are {ANGLE}<joint>, {_offered()}."
            )
        if header.count(name) > 1:
            raise ReadingsError(f"{path}: the column {name!r} stands there twice.")
    if not any(name.startswith(ANGLE) for name in header):
        raise ReadingsError(f"{path}: no column says what was commanded; write {ANGLE}<joint>.")
    if len(header) == sum(name.startswith(ANGLE) for name in header):
        examples = (modality.columns(1)[0] for modality in MODALITIES.values())
        raise ReadingsError(
            f"{path}: no column says what was felt; write {', '.join(islice(examples, 2))}, …"
        )


def _offered() -> str:
    """The columns of all modalities, as a list in a sentence."""
    names: list[str] = []
    for modality in MODALITIES.values():
        columns = modality.columns(1)
        if modality.on_parts:
            columns = tuple(f"{column} to {column[:-1]}n" for column in columns)
        names += columns
    return f"{', '.join(names[:-1])} and {names[-1]}"


def _observation(
    where: str, header: list[str], row: list[str], columns: Mapping[str, Sequence[str]]
) -> Observation:
    if len(row) != len(header):
        commas = " Write numbers with points." if len(row) > len(header) else ""
        raise ReadingsError(
            f"{where}: has {len(row)} cells, and the header has {len(header)}.{commas}"
        )
    cells = dict(zip(header, row, strict=True))
    angles: list[float] = []
    for name, cell in cells.items():
        if name.startswith(ANGLE):
            angle = parse_number(where, name, cell, -180.0, 180.0)
            if angle is None:
                raise ReadingsError(f"{where}: {name} is empty; write the angle commanded.")
            angles.append(math.radians(angle))
    readings: dict[str, Any] = {}
    for modality in MODALITIES.values():
        named = [(column, cells.get(column, "")) for column in columns[modality.name]]
        readings |= modality.field([modality.parse(where, *item) for item in named])
    return Observation(angles=tuple(angles), **readings)
