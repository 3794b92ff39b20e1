"""``robot.toml``: what is connected where, and how it is calibrated.

``robot/robot.toml`` is the documented example; this module is its meaning. Degrees and millimetres
in the file, because a person writes it; radians and metres in the objects.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from pathlib import Path

from robot.calibration import DrivenJoint, JointScale
from robot.drivers.dmm32 import RANGES
from robot.errors import ConfigError
from robot.sections import Section, read_toml
from robot.sensing import Accelerometer, BellySensor
from robot.settling import RestCriterion
from robot.touch import TouchGauge


@dataclass(frozen=True, kw_only=True)
class BodyConfig:
    """What ``hello`` makes public about the body: size (x, y, z) in m and mass in kg."""

    size: tuple[float, ...]
    mass: float


@dataclass(frozen=True, kw_only=True)
class ServoBoardConfig:
    """The serial line to the servo board."""

    port: str
    baud: int
    board: int
    line_gap: float


@dataclass(frozen=True, kw_only=True)
class DaqConfig:
    """The data acquisition board: I/O base address and input range."""

    base: int
    input_range: str


@dataclass(frozen=True, kw_only=True)
class I2CConfig:
    """Where the distance sensor sits, and its calibration."""

    bus: int
    address: int
    sensor: BellySensor


@dataclass(frozen=True, kw_only=True)
class NoiseConfig:
    """Root mean square errors of one observation, as ``hello`` announces them (rad, m)."""

    tilt: float
    clearance: float


@dataclass(frozen=True, kw_only=True)
class RobotConfig:
    """Everything the daemon needs to know about its robot."""

    name: str
    body: BodyConfig
    servo_board: ServoBoardConfig
    joints: tuple[DrivenJoint, ...]
    speed: float
    daq: DaqConfig
    accelerometer: Accelerometer
    gauges: tuple[TouchGauge, ...]
    distance: I2CConfig | None
    settling: RestCriterion
    samples: int
    noise: NoiseConfig

    def __post_init__(self) -> None:
        outputs = [joint.output for joint in self.joints]
        names = [joint.name for joint in self.joints]
        if len(set(outputs)) < len(outputs):
            raise ConfigError(f"two joints share an output: {outputs}.", key="joint")
        if len(set(names)) < len(names):
            raise ConfigError(f"two joints share a name: {names}.", key="joint")

    @property
    def hash(self) -> str:
        """Twelve hex digits that change whenever the configuration does."""
        return hashlib.sha256(repr(self).encode()).hexdigest()[:12]


def load_config(path: Path) -> RobotConfig:
    """Reads ``robot.toml``.

    Raises:
        ConfigError: Names file, key and reason.
    """
    root = read_toml(path)
    head = root.table("robot")
    name = head.text("name")
    _check_count(root, head, "joints", "joint", 1)
    _check_count(root, head, "touch_sensors", "touch", 0)
    head.done()
    body = root.table("body")
    board = root.table("servo_board")
    motion = root.table("motion")
    daq = root.table("daq")
    settling = root.table("settling")
    noise = root.table("noise")
    try:
        config = RobotConfig(
            name=name,
            body=BodyConfig(
                size=tuple(mm / 1000 for mm in body.numbers("size_mm", 3, 1, 10_000)),
                mass=body.number("mass_kg", 1e-3, 1000),
            ),
            servo_board=ServoBoardConfig(
                port=board.text("port"),
                baud=board.integer("baud", 2400, 19200, 9600),
                board=board.integer("board", 0, 255, 1),
                line_gap=board.number("line_gap_ms", 3, 1000, 3) / 1000,
            ),
            joints=tuple(_joint(section) for section in root.tables("joint")),
            speed=math.radians(motion.number("speed_deg_s", 1, 60, 60)),
            daq=DaqConfig(
                base=daq.integer("base", 0x100, 0x3F0, 0x300),
                input_range=daq.choice("input_range", tuple(RANGES), "±5V"),
            ),
            accelerometer=_accelerometer(root.table("accelerometer")),
            gauges=tuple(_gauge(s) for s in root.tables("touch")) if root.has("touch") else (),
            distance=_distance(root.table("distance")) if root.has("distance") else None,
            settling=_settling(settling),
            samples=settling.integer("samples", 1, 1000, 10),
            noise=NoiseConfig(
                tilt=math.radians(noise.number("tilt_deg", 0, 90)),
                clearance=noise.number("clearance_mm", 0, 1000) / 1000,
            ),
        )
    except ConfigError as error:
        raise ConfigError(error.reason, file=str(path), key=error.key) from error
    for section in (body, board, motion, daq, settling, noise, root):
        section.done()
    return config


def _check_count(root: Section, head: Section, key: str, table: str, least: int) -> None:
    """A file that lost its end would otherwise describe a smaller robot."""
    said = head.integer(key, least, 32)
    found = len(root.tables(table)) if root.has(table) else 0
    if said != found:
        raise head.refuse(key, f"says {said}, but {found} [[{table}]] tables follow; lost the end?")


def _joint(section: Section) -> DrivenJoint:
    lower, upper = section.numbers("limits_deg", 2, -180, 180)
    if lower >= upper:
        raise section.refuse("limits_deg", f"must rise, not {lower:g} to {upper:g}.")
    pairs = section.pairs("calibration")
    try:
        joint = DrivenJoint(
            name=section.text("name"),
            output=section.integer("output", 1, 8),
            lower_limit=math.radians(lower),
            upper_limit=math.radians(upper),
            part_radius=section.number("part_radius_mm", 0.1, 1000) / 1000,
            scale=JointScale(tuple((count, math.radians(angle)) for count, angle in pairs)),
        )
        if not joint.reachable[0] < 0 < joint.reachable[1]:
            raise ValueError("must reach the zero pose: 0° lies outside what it spans")
    except ValueError as error:
        raise section.refuse("calibration", f"{error}.") from error
    section.done()
    return joint


def _accelerometer(section: Section) -> Accelerometer:
    channels = section.numbers("channels", 3, 0, 31)
    gains = section.numbers("volts_per_g", 3, -10, 10)
    if any(channel != int(channel) for channel in channels) or len(set(channels)) < 3:
        raise section.refuse("channels", f"must be three different integers, not {channels}.")
    if 0 in gains:
        raise section.refuse("volts_per_g", "must not be 0.")
    found = Accelerometer(
        channels=tuple(int(channel) for channel in channels),
        zero=section.numbers("zero_v", 3, -10, 10),
        volts_per_g=gains,
    )
    section.done()
    return found


def _gauge(section: Section) -> TouchGauge:
    on = section.number("on_n", 0, 1000, 0.1)
    off = section.number("off_n", 0, 1000, on / 2)
    gain = section.number("volts_per_newton", -100, 100)
    if off > on:
        raise section.refuse("off_n", f"must not exceed on_n ({on:g}), not {off:g}.")
    if gain == 0:
        raise section.refuse("volts_per_newton", "must not be 0.")
    gauge = TouchGauge(
        name=section.text("name"),
        channel=section.integer("channel", 0, 31),
        tare=section.number("tare_v", -10, 10),
        volts_per_newton=gain,
        on=on,
        off=off,
        debounce=section.integer("debounce", 1, 100, 3),
    )
    section.done()
    return gauge


def _distance(section: Section) -> I2CConfig:
    found = I2CConfig(
        bus=section.integer("bus", 0, 255),
        address=section.integer("address", 0x08, 0x77, 0x29),
        sensor=BellySensor(
            zero=section.number("zero_mm", 0, 255) / 1000,
            reach=section.number("range_mm", 1, 255) / 1000,
        ),
    )
    section.done()
    return found


def _settling(section: Section) -> RestCriterion:
    return RestCriterion(
        window=section.number("window_s", 0.05, 60, 0.3),
        swing=math.radians(section.number("swing_deg", 0, 90, 0.5)),
        drift=math.radians(section.number("drift_deg", 0, 90, 0.1)),
        timeout=section.number("timeout_s", 0.1, 600, 5),
        rate=section.number("rate_hz", 1, 1000, 50),
    )
