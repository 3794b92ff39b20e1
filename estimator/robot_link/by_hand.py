"""Readings that a person wrote down: ``readings.csv`` with ``robot.json`` beside it.

``readings.csv`` is described in ``estimator.readings.readings_csv``. ``robot.json`` says what a
robot would say about itself; every run writes one, and by hand three keys are enough::

    {"base_size": [0.14, 0.14, 0.085], "base_mass": 0.6, "clearance_upper": 0.2}

in m and kg; ``clearance_upper`` is the largest clearance that could have been measured. A sensor
without a column was not read, so it counts as one that the robot lacks.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from estimator.errors import ReadingsError
from estimator.readings.modalities.registry import MODALITIES
from estimator.readings.observation import Observation
from estimator.readings.plausibility import impossible_reading
from estimator.readings.readings_csv import ANGLE, Table, read
from estimator.robot_link.replay import Record
from protocol.errors import LocalProtocolError
from protocol.wire.capabilities import Capabilities

ROBOT_FILE: Final = "robot.json"
_SLEW: Final = math.radians(60.0)  # the paper's servos


def open_by_hand(path: Path, driven: Callable[[Capabilities], Collection[int]]) -> Record:
    """Readings by hand as a robot link.

    Args:
        path: The table.
        driven: Says which motors' angles every row must say; the others stand at 0 without a
            column.

    Raises:
        ReadingsError: A file cannot be read or is wrong; the message names it and the reason.
    """
    table = read(path)
    robot = path.with_name(ROBOT_FILE)
    capabilities = _capabilities(robot, path, table)
    names = [joint.name for joint in capabilities.joints]
    unknown = [name for name in table.joints if name not in names]
    if unknown:
        raise ReadingsError(
            f"{path}: the robot has no joint {', '.join(unknown)}; {robot} names "
            f"{', '.join(names)}."
        )
    missing = [names[motor] for motor in driven(capabilities) if motor < len(names)]
    missing = [name for name in missing if name not in table.joints]
    if missing:
        raise ReadingsError(
            f"{path}: the problem drives {', '.join(missing)}, so write the columns "
            f"{', '.join(ANGLE + name for name in missing)}."
        )
    observations = tuple(_for_all_joints(row, table.joints, names) for row in table.observations)
    for number, row in enumerate(observations, 1):
        wrong = impossible_reading(row, capabilities)
        if wrong is not None:
            raise ReadingsError(f"{path}, row {number}: says {wrong}: correct that, or {robot}.")
    return Record(capabilities, tuple(row.angles for row in observations), observations)


def _capabilities(robot: Path, path: Path, table: Table) -> Capabilities:
    advice = 'write at least {"base_size": [x, y, z], "base_mass": m} there, in m and kg'
    try:
        description = json.loads(robot.read_text("utf-8"))
    except OSError as error:
        raise ReadingsError(
            f"{path} says nothing about the main body, and {robot} cannot be read "
            f"({error.strerror}): {advice}."
        ) from error
    except (ValueError, RecursionError) as error:
        raise ReadingsError(f"{robot} is no JSON file: {error}.") from error
    if not isinstance(description, dict):
        raise ReadingsError(f"{robot} must hold an object: {advice}.")
    missing = [key for key in ("base_size", "base_mass") if key not in description]
    if missing:
        raise ReadingsError(f"{robot} lacks {', '.join(missing)}: {advice}.")
    try:
        said = Capabilities.from_map({**_assumed(description, table), **description})
    except LocalProtocolError as error:
        raise ReadingsError(f"{robot}: {error}.") from error
    for sensor in said.sensors:
        count, modality = table.counts[sensor.modality], MODALITIES[sensor.modality]
        if modality.on_parts and count not in (0, sensor.count):
            raise ReadingsError(
                f"{path} has {count} {modality.name} columns, but the robot has {sensor.count} "
                f"such sensors by {robot}: write a column for each, empty where nothing was read, "
                "or none."
            )
    return replace(said, sensors=tuple(one for one in said.sensors if table.counts[one.modality]))


def _assumed(description: dict[str, Any], table: Table) -> dict[str, Any]:
    """Returns capabilities that the table implies, and defaults for those that do not matter."""
    sensors = []
    for name, modality in MODALITIES.items():
        sensor = {"modality": name, "unit": modality.unit, "count": table.counts[name]}
        if modality.upper is not None:
            sensor["upper"] = description.get(f"{name}_upper", modality.upper)
        sensors.append(sensor)
    return {
        "robot": "by hand",
        "software": "none",
        "config_hash": "none",
        "joints": [
            {"name": name, "lower": -math.pi, "upper": math.pi, "speed": _SLEW, "resolution": 0.0}
            for name in table.joints
        ],
        "sensors": [{"noise": 0.0, "rate": 1.0, **item} for item in sensors if item["count"]],
        "telemetry": "none",
        "telemetry_rate": 1.0,
    }


def _for_all_joints(row: Observation, columns: tuple[str, ...], names: list[str]) -> Observation:
    angles = dict(zip(columns, row.angles, strict=True))
    return row.model_copy(update={"angles": tuple(angles.get(name, 0.0) for name in names)})
