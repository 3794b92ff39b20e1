"""``robot.toml``: what is connected where, and how it is calibrated.

``robot/robot.toml`` is the documented example; this module reads it. Degrees and millimetres
in the file, because a person writes it; radians and metres in the objects.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, cast

from protocol.system.files import may_exist
from robot.configuration.calibration_file import (
    Calibration,
    calibration_command,
    read_calibration,
)
from robot.configuration.device_tables import (
    check_count,
    check_rest,
    read_accelerometer,
    read_board,
    read_distance,
    read_joint,
    read_settling,
    read_touch,
)
from robot.configuration.joint_calibration import DrivenJoint
from robot.drivers.registry import SERVOS, read_settings
from robot.drivers.sensors.analogue import StrainGauge
from robot.drivers.sensors.contracts import BoardSettings, CalibratedAxes, SensorSettings
from robot.drivers.servos.servo_bus import ServoSettings
from robot.errors import ConfigError
from robot.sensing.samples import RestCriterion
from robot.sensing.sensors import BellySensor, TouchPoint, Underside
from robot.toml_sections import Section, numbered, read_toml

DENSITIES: Final = (10.0, 20_000.0)
"""Least and greatest density of a main body, kilograms per cubic metre."""


@dataclass(frozen=True, kw_only=True)
class BodyConfig:
    """The main body.

    Attributes:
        size: Size along x, y, z, m; ``hello`` makes it public.
        radius: Radius of a round main body, an upright cylinder, m; ``None``: it is a box.
        mass: Mass of the main body, kg.
        lies_flat: Whether it lies on the ground with all joints at 0.
    """

    size: tuple[float, ...]
    radius: float | None
    mass: float
    lies_flat: bool


@dataclass(frozen=True, kw_only=True)
class NoiseConfig:
    """Root mean square errors of one observation, as ``hello`` announces them (rad, m).

    ``joint`` is the error of a measured angle, of servos that report theirs: backlash, mostly.
    """

    tilt: float
    clearance: float
    joint: float


@dataclass(frozen=True, kw_only=True)
class RobotConfig:
    """Everything the daemon needs to know about its robot."""

    name: str
    body: BodyConfig
    servos: ServoSettings
    joints: tuple[DrivenJoint, ...]
    speed: float
    daq: BoardSettings | None
    accelerometer: SensorSettings | None
    touch: tuple[TouchPoint, ...]
    distance: BellySensor | None
    settling: RestCriterion
    samples: int
    noise: NoiseConfig

    def __post_init__(self) -> None:
        joints = [joint.name for joint in self.joints]
        points = [point.name for point in self.touch]
        _all_different("joint", joints, "name", joints)
        _all_different("joint", joints, "output", [joint.output for joint in self.joints])
        _all_different("touch", points, "name", points)
        self._check_claims()
        self._check_inputs()
        channels = [channel for driver in self.sensors.values() for channel in driver.channels]
        for number, point in enumerate(self.touch, 1):
            key = numbered("touch", number, point.name)
            for channel in point.driver.channels:
                if channels.count(channel) > 1:
                    raise ConfigError(
                        f"input {channel} is another sensor's, too: each has one of its own.",
                        key=f"{key}.channel",
                    )
            if point.debounce > self.samples:
                raise ConfigError(
                    f"a debounce of {point.debounce} can never set the bit: an observation has "
                    f"only {self.samples} samples.",
                    key=f"{key}.debounce",
                )

    def _check_inputs(self) -> None:
        """Checks that the board has the inputs that sensors are connected to."""
        for table, driver in self._sensor_tables.items():
            key = f"{table}.channel{'s' if driver.channels[1:] else ''}"
            for channel in driver.channels:
                if self.daq is None:
                    raise ConfigError("is missing: sensors are connected to its inputs.", key="daq")
                if channel not in self.daq.inputs:
                    raise ConfigError(
                        f"names input {channel}, and the board ({self.daq.name}: {self.daq}) has "
                        f"inputs {self.daq.inputs[0]} to {self.daq.inputs[-1]}.",
                        key=key,
                    )

    def _check_claims(self) -> None:
        """Checks that no two devices have the same address."""
        tables = {"servos": self.servos, "daq": self.daq, **self._sensor_tables}
        owners: dict[str, str] = {}
        for table, settings in tables.items():
            for place in getattr(settings, "claims", ()):
                if place in owners:
                    raise ConfigError(
                        f"is at {place}, where {owners[place]} answers already: each device has an "
                        "address of its own.",
                        key=table,
                    )
                owners[place] = table

    @property
    def sensors(self) -> Mapping[str, SensorSettings]:
        """The drivers of all sensors, as a person calls them: ``touch NAME``, or by their table."""
        sensors = {
            "accelerometer": self.accelerometer,
            **{f"touch {point.name}": point.driver for point in self.touch},
            "distance": self.distance.driver if self.distance is not None else None,
        }
        return {subject: driver for subject, driver in sensors.items() if driver is not None}

    @property
    def _sensor_tables(self) -> Mapping[str, SensorSettings]:
        """The drivers of all sensors, by the names of their tables for messages."""
        numbers = {
            f"touch {point.name}": numbered("touch", number, point.name)
            for number, point in enumerate(self.touch, 1)
        }
        return {numbers.get(subject, subject): driver for subject, driver in self.sensors.items()}

    @property
    def axes(self) -> CalibratedAxes | None:
        """The accelerometer, if it is one that can be calibrated."""
        return self.accelerometer if isinstance(self.accelerometer, CalibratedAxes) else None

    @property
    def gauges(self) -> Mapping[str, StrainGauge]:
        """The touch sensors on analogue inputs, by name: only these can be calibrated."""
        return {
            point.name: point.driver
            for point in self.touch
            if isinstance(point.driver, StrainGauge)
        }

    @property
    def underside(self) -> Underside:
        """The belly, with a margin for the noise that ``hello`` announces."""
        return Underside(
            size=self.body.size[:2],
            round=self.body.radius is not None,
            tilt_noise=self.noise.tilt,
            clearance_noise=self.noise.clearance,
        )

    @property
    def hash(self) -> str:
        """Twelve hex digits that change whenever the configuration does."""
        return hashlib.sha256(repr(self).encode()).hexdigest()[:12]


def _all_different(table: str, names: Sequence[str], key: str, values: Sequence[str | int]) -> None:
    for index, value in enumerate(values):
        first = values.index(value)
        if first < index:
            raise ConfigError(
                f"is {value!r:.80}, as that of {numbered(table, first + 1, names[first])}: each "
                "has one of its own.",
                key=f"{numbered(table, index + 1, names[index])}.{key}",
            )


_WIDTHS: Final = (5.0, 2000.0)  # mm, of a main body


def _read_size(section: Section) -> tuple[tuple[float, ...], float | None]:
    """Extents along x, y and z, m, and the radius of a round main body."""
    if not (section.has("radius_mm") or section.has("height_mm")):
        return tuple(mm / 1000 for mm in section.numbers("size_mm", 3, *_WIDTHS)), None
    if section.has("size_mm"):
        raise section.refuse("size_mm", "is that of a box; a round body has radius_mm, height_mm.")
    for key, other_key in (("radius_mm", "height_mm"), ("height_mm", "radius_mm")):
        if not section.has(key):
            raise section.refuse(key, f"is missing: a round body has one beside its {other_key}.")
    least, most = _WIDTHS
    radius = section.number("radius_mm", least / 2, most / 2) / 1000
    return (2 * radius, 2 * radius, section.number("height_mm", 1, most) / 1000), radius


def _dense_enough(
    section: Section, size: Sequence[float], radius: float | None, mass: float
) -> float:
    """The mass, if there can be a body of that mass and size (x, y, z in m)."""
    density = mass / (math.prod(size) if radius is None else math.pi * radius**2 * size[2])
    if not DENSITIES[0] <= density <= DENSITIES[1]:
        raise section.refuse(
            "mass_kg",
            f"is {mass:g} for a body of {' x '.join(f'{1000 * m:g}' for m in size)} mm: that is "
            f"{density:.3g} kg per cubic metre, and foam has {DENSITIES[0]:g}, gold "
            f"{DENSITIES[1]:g}; write kilograms, and its size in millimetres.",
        )
    return mass


def load_config(path: Path, *, uncalibrated: bool = False) -> RobotConfig:
    """Reads ``robot.toml`` and the calibration file that it names, whose values come first.

    Args:
        path: The ``robot.toml``.
        uncalibrated: Whether the calibration file may be missing; the values of ``robot.toml``
            stand then. Nothing that moves by itself should begin like that.

    Raises:
        ConfigError: Names file, key and reason.
    """
    config, calibration = read_config(path)
    if calibration is not None and not uncalibrated and not may_exist(calibration):
        raise ConfigError(
            f"names {calibration}, which does not exist. Write it with: "
            f"{calibration_command(path)}; or leave [calibration] out.",
            file=str(path),
            key="calibration.file",
        )
    return with_calibration(config, calibration)[0]


def with_calibration(config: RobotConfig, file: Path | None) -> tuple[RobotConfig, Calibration]:
    """Applies the values of a calibration file, which need not exist; returns both.

    Raises:
        ConfigError: Names file, key and reason.
    """
    if file is None or not may_exist(file):
        return config, Calibration(robot=config.name)
    calibration = read_calibration(file, config.servos.known_counts)
    return apply_calibration(config, calibration, file=str(file)), calibration


def apply_calibration(config: RobotConfig, calibration: Calibration, *, file: str) -> RobotConfig:
    """Returns a configuration with the values of a calibration in the place of its own.

    Raises:
        ConfigError: The calibration is another robot's, or does not fit; names ``file`` and key.
    """
    if calibration.robot != config.name:
        raise ConfigError(
            f"was made for {calibration.robot!r}, and this robot is {config.name!r}.",
            file=file,
            key="robot",
        )
    _check_known("joint", calibration.joints, (joint.name for joint in config.joints), file)
    _check_known("touch", calibration.gauges, config.gauges, file)
    joints = tuple(_calibrated(joint, calibration, file) for joint in config.joints)
    touch = tuple(_calibrated_touch(point, calibration, file) for point in config.touch)
    accelerometer, distance = config.accelerometer, config.distance
    if calibration.accelerometer is not None:
        measured = calibration.accelerometer
        if config.axes is None or config.axes.unit != measured.unit:
            kind = "volts" if measured.unit == "V" else measured.unit
            fitted = f"the {accelerometer.name}" if accelerometer else "no accelerometer"
            raise ConfigError(
                f"calibrates {kind}, and this robot has {fitted}. Remove it.",
                file=file,
                key="accelerometer",
            )
        _check_wiring("accelerometer", "", measured.wiring, config.axes.wiring, file)
        calibrated = replace(
            config.axes,
            zero=measured.zero,
            per_g=measured.per_g,
            uncertainty=measured.uncertainty,
        )
        accelerometer = cast(SensorSettings, calibrated)
    if calibration.distance is not None:
        if distance is None:
            raise ConfigError(
                "calibrates a sensor that robot.toml does not have. Remove it, or add it there.",
                file=file,
                key="distance",
            )
        distance = replace(distance, **vars(calibration.distance))
    return replace(
        config, joints=joints, touch=touch, accelerometer=accelerometer, distance=distance
    )


def _calibrated_touch(point: TouchPoint, calibration: Calibration, file: str) -> TouchPoint:
    gauge = calibration.gauges.get(point.name)
    if gauge is None or not isinstance(point.driver, StrainGauge):
        return point
    was, now = {"channel": gauge.channel}, {"channel": point.driver.channel}
    _check_wiring("touch", point.name, was, now, file)
    driver = replace(point.driver, tare=gauge.tare, volts_per_newton=gauge.volts_per_newton)
    return replace(point, driver=driver, on=gauge.on, off=gauge.off)


def _check_wiring(
    table: str, name: str, was: Mapping[str, object], now: Mapping[str, object], file: str
) -> None:
    if was != now:
        raise ConfigError(
            f"was calibrated with {_wiring_text(was)}, and robot.toml has {_wiring_text(now)}: "
            "what was measured does not hold there. Change robot.toml back, or remove this table "
            f"and calibrate it anew: robotd calibrate with --only {name or table}.",
            file=file,
            key=f"{table} ({name})" if name else table,
        )


def _wiring_text(wiring: Mapping[str, object]) -> str:
    return ", ".join(f"{key} = {json.dumps(value)}" for key, value in wiring.items()) or "no wiring"


def _check_known(key: str, names: Iterable[str], known: Iterable[str], file: str) -> None:
    unknown = sorted(set(names) - set(known))
    if unknown:
        raise ConfigError(
            f"the robot has no {unknown[0]!r}. Remove it here, or add it to robot.toml.",
            file=file,
            key=key,
        )


def _calibrated(joint: DrivenJoint, calibration: Calibration, file: str) -> DrivenJoint:
    if joint.name not in calibration.joints:
        return joint
    measured = calibration.joints[joint.name]
    _check_wiring("joint", joint.name, {"output": measured.output}, {"output": joint.output}, file)
    calibrated = replace(joint, **vars(measured))
    try:
        calibrated.check_zero()
    except ValueError as error:
        raise ConfigError(f"{joint.name!r} {error}.", file=file, key="joint.calibration") from error
    return calibrated


def read_config(path: Path) -> tuple[RobotConfig, Path | None]:
    """Reads ``robot.toml`` alone.

    Returns:
        The values of ``robot.toml``, and the calibration file that it names, or ``None``.

    Raises:
        ConfigError: Names file, key and reason.
    """
    root = read_toml(path)
    head = root.table("robot")
    name = head.text("name")
    check_count(root, head, "joints", "joint", 1)
    check_count(root, head, "touch_sensors", "touch", 0)
    head.done()
    calibration = None
    if root.has("calibration"):
        table = root.table("calibration")
        calibration = path.parent / table.text("file")
        table.done()
    body = root.table("body")
    board = root.table("servos")
    servos: ServoSettings = read_settings(board, SERVOS, "sv203")
    motion = root.table("motion")
    settling = root.table("settling")
    noise = root.table("noise")
    try:
        size, radius = _read_size(body)
        config = RobotConfig(
            name=name,
            body=BodyConfig(
                size=size,
                radius=radius,
                mass=_dense_enough(body, size, radius, body.number("mass_kg", 0.01, 100)),
                lies_flat=body.choice("zero_pose", ("flat", "standing"), "flat") == "flat",
            ),
            servos=servos,
            joints=tuple(read_joint(section, servos) for section in root.tables("joint")),
            speed=math.radians(motion.number("speed_deg_s", 5, 60, 60)),
            daq=read_board(root.table("daq")) if root.has("daq") else None,
            accelerometer=read_accelerometer(root.table("accelerometer"))
            if root.has("accelerometer")
            else None,
            touch=tuple(read_touch(s) for s in root.tables("touch")) if root.has("touch") else (),
            distance=read_distance(root.table("distance")) if root.has("distance") else None,
            settling=read_settling(settling),
            samples=settling.integer("samples", 1, 1000, 10),
            noise=NoiseConfig(
                tilt=math.radians(noise.number_or_zero("tilt_deg", 0.01, 10)),
                clearance=noise.number_or_zero("clearance_mm", 0.01, 50) / 1000,
                joint=math.radians(noise.number("joint_deg", 0.01, 10, 0.5)),
            ),
        )
        if config.accelerometer is not None:
            check_rest(settling, config.settling)
    except ConfigError as error:
        raise ConfigError(error.reason, file=str(path), key=error.key) from error
    for section in (body, board, motion, settling, noise, root):
        section.done()
    return config, calibration
