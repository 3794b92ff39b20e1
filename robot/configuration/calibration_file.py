"""``calibration.toml``: what ``robotd calibrate`` found out, in a file of its own.

Its keys are those of ``robot.toml``, which names the file and whose values give way to it; beside
them stands how each part was connected, which must be so still. What was not calibrated is left
out. The last table tells a whole file from one that was cut off. A file is
replaced in one step, and the previous one is kept under a number.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from protocol.system.files import replace_file
from protocol.text import command_line
from robot.configuration.device_tables import (
    AXES_SIGMAS,
    DISTANCE_SIGMAS,
    JOINT_SIGMAS,
    read_distance_calibration,
    read_limits,
    read_scale,
    read_thresholds,
)
from robot.configuration.joint_calibration import JointScale
from robot.drivers.sensors.analogue import read_bridge
from robot.drivers.sensors.contracts import AXIS_KEYS, LAST_INPUT, MOUNTING_KEYS, read_axes
from robot.errors import ConfigError
from robot.toml_sections import Section, read_toml, toml_section
from robot.uncertainty import Uncertainty

SCHEMA: Final = 2
_DECIMALS: Final = 5  # behind the point: 0.00001° and 10 µV are beyond any sensor here
_HEAD: Final = """\
# Written by robotd calibrate, which keeps the file before it under a number. robot.toml names this
# file, and its keys mean the same there; what stands here takes their place, save output, counts,
# channel, channels, forward, left and up: they say how a part was connected when it was calibrated.
"""
_FOOT: Final = """

[end]  # a file without this line was cut off
"""


@dataclass(frozen=True, kw_only=True)
class JointCalibration:
    """Mechanical limits of a joint, rad, the scale of its counts, and how well these are known.

    It holds for one output, and for a driver that knows the counts that the file names.
    """

    output: int
    lower_limit: float
    upper_limit: float
    scale: JointScale
    uncertainty: Uncertainty = Uncertainty()


@dataclass(frozen=True, kw_only=True)
class AxesCalibration:
    """What the accelerometer's axes x, y, z read at 0 g and per g, in their unit, V or g.

    It holds for one ``CalibratedAxes.wiring``.
    """

    wiring: Mapping[str, str | tuple[int, ...]]
    unit: str
    zero: tuple[float, ...]
    per_g: tuple[float, ...]
    uncertainty: Uncertainty = Uncertainty()


@dataclass(frozen=True, kw_only=True)
class GaugeCalibration:
    """Volts of the unloaded gauge, volts per newton, loads that switch touch on and off, N.

    It holds for one analogue input, ``channel``.
    """

    channel: int
    tare: float
    volts_per_newton: float
    on: float
    off: float


@dataclass(frozen=True, kw_only=True)
class DistanceCalibration:
    """Reading with the belly on the ground, m, and metres of clearance per metre of reading."""

    zero: float
    scale: float
    uncertainty: Uncertainty = Uncertainty()


Part = JointCalibration | AxesCalibration | GaugeCalibration | DistanceCalibration
"""Calibration of one part: of what is calibrated at one go."""


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """One calibration of one robot, of those parts that were calibrated; joints and gauges by name.

    Attributes:
        robot: The robot's name; the file fits no other.
        revision: Number that grows by one with each file that replaces another.
        made: Time at which it was made, ISO 8601, UTC.
    """

    robot: str
    revision: int = 0
    made: str = "never"
    joints: Mapping[str, JointCalibration] = field(default_factory=dict)
    accelerometer: AxesCalibration | None = None
    gauges: Mapping[str, GaugeCalibration] = field(default_factory=dict)
    distance: DistanceCalibration | None = None

    def with_part(self, name: str, part: Part) -> Calibration:
        """A copy with another calibration of one part; ``name`` is a joint's or a gauge's."""
        match part:
            case JointCalibration():
                return replace(self, joints={**self.joints, name: part})
            case GaugeCalibration():
                return replace(self, gauges={**self.gauges, name: part})
            case AxesCalibration():
                return replace(self, accelerometer=part)
            case DistanceCalibration():
                return replace(self, distance=part)


def calibration_command(config: str | Path, *parts: str) -> str:
    """The command, to be typed in a shell, that writes the calibration file.

    Args:
        config: The robot's ``robot.toml``.
        parts: Names of the parts to calibrate; none for all of them.
    """
    only = ["--only", *parts] if parts else []
    return command_line("robotd", "calibrate", "--config", config, *only)


def read_calibration(path: Path, counts: range) -> Calibration:
    """Reads a calibration file.

    Args:
        path: The file.
        counts: Counts that the robot's servo driver knows.

    Raises:
        ConfigError: Names file, key and reason.
    """
    return _calibration(read_toml(path), counts)


def check_calibration(calibration: Calibration, counts: range) -> None:
    """Checks that the file that would be written of a calibration could be read again.

    Args:
        calibration: The calibration.
        counts: Counts that the robot's servo driver knows.

    Raises:
        ConfigError: It holds what no robot has; names key and reason.
    """
    _calibration(toml_section(to_toml(replace(calibration, revision=1), counts), ""), counts)


def _calibration(root: Section, counts: range) -> Calibration:
    schema = root.integer("schema", 1, 2**31)
    if schema != SCHEMA:
        raise root.refuse(
            "schema",
            f"is {schema}, and this robotd reads {SCHEMA}: "
            + ("update robotd" if schema > SCHEMA else "add how each part is wired")
            + " (docs/your-robot.md), or move this file away and calibrate anew.",
        )
    root.table("end").done()  # missing where the file was cut off
    calibration = Calibration(
        robot=root.text("robot"),
        revision=root.integer("revision", 1, 2**31),
        made=root.text("made"),
        joints=dict(_joint(section, counts) for section in _named(root, "joint")),
        accelerometer=_axes(root.table("accelerometer")) if root.has("accelerometer") else None,
        gauges=dict(_gauge(section) for section in _named(root, "touch")),
        distance=_distance(root.table("distance")) if root.has("distance") else None,
    )
    root.done()
    return calibration


def _named(root: Section, key: str) -> Iterator[Section]:
    names: set[str] = set()
    for section in root.tables(key) if root.has(key) else []:
        name = section.text("name")
        if name in names:
            raise section.refuse("name", f"{name!r} comes twice.")
        names.add(name)
        yield section


def _joint(section: Section, counts: range) -> tuple[str, JointCalibration]:
    first, last = section.numbers("counts", 2, 1, 2**31)
    if (first, last) != (counts[0], counts[-1]):
        raise section.refuse(
            "counts",
            f"are {first:g} to {last:g}, and the servos have {counts[0]} to "
            f"{counts[-1]} now: with another driver or update rate a count is another angle. "
            "Change [servos] back, or remove this table, and each like it, and calibrate these "
            "joints anew.",
        )
    lower, upper = read_limits(section)
    scale = read_scale(section, counts)
    uncertainty = Uncertainty.read(section, *JOINT_SIGMAS)
    output = section.integer("output", 0, 10_000)
    section.done()
    return section.text("name"), JointCalibration(
        output=output, lower_limit=lower, upper_limit=upper, scale=scale, uncertainty=uncertainty
    )


def _axes(section: Section) -> AxesCalibration:
    unit = "g" if section.has(AXIS_KEYS["g"][0]) else "V"
    zero, gains = read_axes(section, unit)
    uncertainty = Uncertainty.read(section, *AXES_SIGMAS)
    wiring: dict[str, str | tuple[int, ...]] = {
        key: section.text(key) for key in MOUNTING_KEYS if section.has(key)
    }
    if section.has("channels"):
        wiring["channels"] = section.integers("channels", 0, LAST_INPUT, ())
    section.done()
    return AxesCalibration(
        wiring=wiring, unit=unit, zero=zero, per_g=gains, uncertainty=uncertainty
    )


def _gauge(section: Section) -> tuple[str, GaugeCalibration]:
    tare, gain = read_bridge(section)
    on, off = read_thresholds(section)
    channel = section.integer("channel", 0, LAST_INPUT)
    section.done()
    return section.text("name"), GaugeCalibration(
        channel=channel, tare=tare, volts_per_newton=gain, on=on, off=off
    )


def _distance(section: Section) -> DistanceCalibration:
    zero, scale = read_distance_calibration(section)
    uncertainty = Uncertainty.read(section, *DISTANCE_SIGMAS)
    section.done()
    return DistanceCalibration(zero=zero, scale=scale, uncertainty=uncertainty)


def to_toml(calibration: Calibration, counts: range) -> str:
    """The text of the file; ``counts`` are those that the robot's servo driver knows."""
    lines = [
        f"schema = {SCHEMA}",
        f"revision = {calibration.revision}",
        f"robot = {_text(calibration.robot)}",
        f"made = {_text(calibration.made)}",
    ]
    if (axes := calibration.accelerometer) is not None:
        zero, gain = AXIS_KEYS[axes.unit]
        lines += [
            "\n[accelerometer]",
            *(f"{key} = {json.dumps(value)}" for key, value in axes.wiring.items()),
            f"{zero} = {_numbers(axes.zero)}",
            f"{gain} = {_numbers(axes.per_g)}",
            *_sigmas(axes.uncertainty, AXES_SIGMAS),
        ]
    if calibration.distance is not None:
        lines += [
            "\n[distance]",
            f"zero_mm = {_number(calibration.distance.zero * 1000)}",
            f"scale = {_number(calibration.distance.scale)}",
            *_sigmas(calibration.distance.uncertainty, DISTANCE_SIGMAS),
        ]
    for name, joint in calibration.joints.items():
        limits = math.degrees(joint.lower_limit), math.degrees(joint.upper_limit)
        points = (_numbers((count, math.degrees(angle))) for count, angle in joint.scale.points)
        lines += [
            "\n[[joint]]",
            f"name = {_text(name)}",
            f"output = {joint.output}",
            f"counts = [{counts[0]}, {counts[-1]}]",
            f"limits_deg = {_numbers(limits)}",
            f"calibration = [{', '.join(points)}]",
            *_sigmas(joint.uncertainty, JOINT_SIGMAS),
        ]
    for name, gauge in calibration.gauges.items():
        lines += [
            "\n[[touch]]",
            f"name = {_text(name)}",
            f"channel = {gauge.channel}",
            f"tare_v = {_number(gauge.tare)}",
            f"volts_per_newton = {_number(gauge.volts_per_newton)}",
            f"on_n = {_number(gauge.on)}",
            f"off_n = {_number(gauge.off)}",
        ]
    return _HEAD + "\n".join(lines) + _FOOT


def save_calibration(
    path: Path, calibration: Calibration, counts: range, *, keep: bool = True
) -> Path | None:
    """Writes a calibration file in one step: at any moment there is the old one or the new one.

    Args:
        path: The file.
        calibration: Calibration to write.
        counts: Counts that the robot's servo driver knows.
        keep: Whether the previous file is kept under a number.

    Returns:
        Path under which the previous file was kept, or ``None`` if none was.

    Raises:
        ConfigError: The disk is full, the folder is not ours, …; the old file stands.
    """
    path = path.resolve()  # a link stays a link
    backup = None
    try:
        if keep and path.exists():
            backup = _free_name(path)
            _write(backup, path.read_bytes())
        _write(path, to_toml(calibration, counts).encode())
    except OSError as error:
        raise ConfigError(
            f"cannot be written: {error.strerror}. The file before, if any, still stands.",
            file=str(path),
        ) from error
    return backup


def _free_name(path: Path) -> Path:
    number = 1
    while (name := path.with_name(f"{path.name}.{number}")).exists():
        number += 1
    return name


def _write(path: Path, data: bytes) -> None:
    # Whoever calibrates, the daemon must be able to read it.
    replace_file(path, lambda fresh: fresh.write_bytes(data), mode=0o644)


def _number(value: float) -> str:
    rounded = round(value, _DECIMALS)
    return str(int(rounded)) if rounded == int(rounded) else repr(rounded)


def _numbers(values: Sequence[float]) -> str:
    return f"[{', '.join(_number(value) for value in values)}]"


def _sigmas(known: Uncertainty, keys: tuple[str, str]) -> list[str]:
    return [f"{key} = {_number(value)}" for key, value in known.written(*keys)]


def _text(value: str) -> str:
    # A JSON string with its letters as they are is a TOML string, save for the character DEL.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
