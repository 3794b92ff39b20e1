"""Records in place of a robot: a table that a person wrote down, or the readings of a recorded run.

``readings.csv`` is described in ``estimator.readings.readings_csv``. ``robot.json`` says what a
robot would say about itself; every run writes one, and by hand three keys are enough::

    {"base_size": [0.14, 0.14, 0.085], "base_mass": 0.6, "clearance_upper": 0.2}

in m and kg; ``clearance_upper`` is the largest clearance that could have been measured. A sensor
without a column was not read, so the robot counts as lacking it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from estimator.errors import InteractionError, ReadingsError, RunDirectoryError
from estimator.readings.modalities import MODALITIES, ROUNDING
from estimator.readings.observation import Observation, Program, same_program
from estimator.readings.plausibility import impossible_reading
from estimator.readings.readings_csv import ANGLE, Table, read
from estimator.storage.records import Ticket
from estimator.storage.store import ROBOT, RunStore
from protocol.errors import LocalProtocolError
from protocol.wire.capabilities import Capabilities


def is_record(uri: str) -> bool:
    """Whether a URI names a record, which cannot move, and not a robot."""
    return uri.startswith(("file:", "replay:"))


class Record:
    """Observations made earlier, as a robot link."""

    def __init__(
        self,
        capabilities: Capabilities,
        programs: tuple[Program, ...],
        observations: tuple[Observation, ...],
    ):
        self.capabilities = capabilities
        self.recorded: tuple[Program, ...] | None = programs
        self._programs = programs
        self._observations = observations

    def ticket(self) -> Ticket | None:
        """Returns ``None``: a record needs no ticket."""
        return None

    def perform(
        self,
        number: int,
        program: Program,
        ticket: Ticket | None,
        on_progress: Callable[[str, float], None],
    ) -> Observation:
        """Returns the observation that was recorded under this number.

        Raises:
            InteractionError: The record holds none, or that of another motor program.
        """
        programs = self._programs
        if number >= len(programs) or not same_program(program, programs[number]):
            raise InteractionError(
                f"interaction {number + 1}: the record does not hold the motor program that the "
                "run had planned: go on with the robot, or start a new run with the record."
            )
        return self._observations[number]

    def outcome(
        self, program: Program, ticket: Ticket, on_progress: Callable[[str, float], None]
    ) -> Observation | None:
        """Returns ``None``: no request to a record can be pending."""
        return None

    def close(self) -> None:
        """Does nothing: a record holds no robot."""


def open_replay(directory: Path) -> Record:
    """Opens the interactions of a recorded run as a robot link.

    Raises:
        RunDirectoryError: There is no run, or nothing was observed in it.
    """
    with RunStore.open(directory, to_write=False) as store:
        performed = [
            (item.program, item.observation)
            for item in store.interactions()
            if item.observation is not None
        ]
        if not performed:
            raise RunDirectoryError(f"{directory} holds no observation that could be replayed.")
        programs, observations = zip(*performed, strict=True)
        return Record(store.capabilities, programs, observations)


_SLEW: Final = math.radians(60.0)  # the paper's servos


def open_by_hand(path: Path, driven: Callable[[Capabilities], Collection[int]]) -> Record:
    """Opens a hand-written table of readings as a robot link.

    Args:
        path: The table.
        driven: Returns the motors whose angles every row must state; the others stand at 0 where
            they have no column.

    Raises:
        ReadingsError: A file cannot be read or is wrong; the message names it and the reason.
    """
    table = read(path)
    robot = path.with_name(ROBOT)
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
    observations = tuple(_as_felt(row, table.joints, capabilities) for row in table.observations)
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


def commanded(taken: Program, robot: Capabilities) -> Program:
    """The motor program that angles in a table count as.

    Where a servo measures its angle the table has that, and not the angle commanded: it may lie
    beyond the joint's ends, and the nearest one within them is taken to be commanded.
    """
    return tuple(
        angle if joint.measured_noise is None else min(max(angle, joint.lower), joint.upper)
        for joint, angle in zip(robot.joints, taken, strict=True)
    )


def _as_felt(row: Observation, columns: tuple[str, ...], robot: Capabilities) -> Observation:
    """A row as this robot would have reported it."""
    angles = dict(zip(columns, row.angles, strict=True))
    taken = tuple(angles.get(joint.name, 0.0) for joint in robot.joints)
    measured = tuple(
        None if joint.measured_noise is None else angle
        for joint, angle in zip(robot.joints, taken, strict=True)
    )
    sensor = robot.sensor("clearance")
    upper = None if sensor is None else sensor.upper
    reaches_upper = (
        row.clearance is not None and upper is not None and row.clearance >= upper - ROUNDING
    )
    return row.model_copy(
        update={
            "angles": commanded(taken, robot),
            "measured": measured,
            "clearance_saturated": reaches_upper,
        }
    )
