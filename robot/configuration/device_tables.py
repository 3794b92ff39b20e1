"""The tables that describe joints, sensors and their calibration in a file of the robot.

``robot.toml`` and the calibration file use the same keys for the same things; this module is what
they mean. Degrees and millimetres in a file, because a person writes it; radians and metres in the
objects.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from robot.configuration.joint_calibration import SLOPES, DrivenJoint, JointScale
from robot.configuration.toml_sections import Section
from robot.sensing.sensors import Accelerometer, BellySensor
from robot.sensing.settling import RestCriterion
from robot.sensing.touch import TouchGauge


@dataclass(frozen=True, kw_only=True)
class I2CConfig:
    """Where the distance sensor sits, and its calibration."""

    bus: int
    address: int
    sensor: BellySensor


_SHORTEST_RANGE: Final = 10.0
"""Degrees from the lower limit to the upper one; a joint typed in radians spans six at most."""


def check_count(root: Section, head: Section, key: str, table: str, least: int) -> None:
    """A file that lost its end would otherwise describe a smaller robot."""
    said = head.integer(key, least, 32)
    found = len(root.tables(table)) if root.has(table) else 0
    if said != found:
        raise head.refuse(key, f"says {said}, but {found} [[{table}]] tables follow; lost the end?")


def read_joint(section: Section) -> DrivenJoint:
    """A ``[[joint]]`` table."""
    lower, upper = read_limits(section)
    joint = DrivenJoint(
        name=section.text("name"),
        output=section.integer("output", 1, 8),
        lower_limit=lower,
        upper_limit=upper,
        part_radius=section.number("part_radius_mm", 1, 200) / 1000,
        scale=read_scale(section),
    )
    try:
        joint.check_zero()
    except ValueError as error:
        raise section.refuse("calibration", f"{error}.") from error
    section.done()
    return joint


def read_limits(section: Section) -> tuple[float, float]:
    """``limits_deg``, in rad."""
    lower, upper = section.numbers("limits_deg", 2, -180, 180)
    if lower >= upper:
        raise section.refuse("limits_deg", f"must rise, not {lower:g} to {upper:g}.")
    if upper - lower < _SHORTEST_RANGE:
        raise section.refuse(
            "limits_deg",
            f"must be at least {_SHORTEST_RANGE:g} degrees apart, not {lower:g} to {upper:g}; "
            "write degrees.",
        )
    return math.radians(lower), math.radians(upper)


def read_scale(section: Section) -> JointScale:
    """``calibration``, pairs of count and degrees."""
    pairs = section.pairs("calibration")
    try:
        scale = JointScale(tuple((count, math.radians(angle)) for count, angle in pairs))
    except ValueError as error:
        raise section.refuse("calibration", f"{error}.") from error
    for (count, angle), (following, next_angle) in pairwise(sorted(pairs)):
        slope = abs((next_angle - angle) / (following - count))
        if not SLOPES[0] <= slope <= SLOPES[1]:
            raise section.refuse(
                "calibration",
                f"has {slope:.3g} degrees a count from count {count:g} to {following:g}, and a "
                f"servo has {SLOPES[0]:g} to {SLOPES[1]:g}; write [count, degrees].",
            )
    return scale


def read_accelerometer(section: Section) -> Accelerometer:
    """The ``[accelerometer]`` table."""
    channels = section.numbers("channels", 3, 0, 31)
    if any(channel != int(channel) for channel in channels) or len(set(channels)) < 3:
        given = ", ".join(f"{channel:g}" for channel in channels)
        raise section.refuse("channels", f"must be three different integers, not {given}.")
    zero, gains = read_axes(section)
    found = Accelerometer(
        channels=tuple(int(channel) for channel in channels), zero=zero, volts_per_g=gains
    )
    section.done()
    return found


def read_axes(section: Section) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """``zero_v`` and ``volts_per_g``."""
    gains = section.magnitudes("volts_per_g", 3, 0.02, 5)
    return section.numbers("zero_v", 3, -10, 10), gains


def read_gauge(section: Section) -> TouchGauge:
    """A ``[[touch]]`` table."""
    tare, gain = read_bridge(section)
    on, off = read_thresholds(section)
    gauge = TouchGauge(
        name=section.text("name"),
        channel=section.integer("channel", 0, 31),
        tare=tare,
        volts_per_newton=gain,
        on=on,
        off=off,
        debounce=section.integer("debounce", 1, 100, 3),
    )
    section.done()
    return gauge


def read_bridge(section: Section) -> tuple[float, float]:
    """``tare_v`` and ``volts_per_newton``."""
    gain = section.magnitude("volts_per_newton", 1e-4, 50)
    return section.number("tare_v", -10, 10), gain


def read_thresholds(section: Section) -> tuple[float, float]:
    """``on_n`` and ``off_n``."""
    on = section.number("on_n", 0, 50, 0.1)
    off = section.number("off_n", 0, 50, on / 2)
    if off > on:
        raise section.refuse("off_n", f"must not exceed on_n ({on:g}), not {off:g}.")
    return on, off


def read_distance(section: Section) -> I2CConfig:
    """The ``[distance]`` table."""
    zero, scale = read_ruler(section)
    reach = section.number("range_mm", 20, 255) / 1000
    found = I2CConfig(
        bus=section.integer("bus", 0, 255),
        address=section.integer("address", 0x08, 0x77, 0x29),
        sensor=BellySensor(zero=zero, scale=scale, reach=reach),
    )
    section.done()
    return found


def read_ruler(section: Section) -> tuple[float, float]:
    """``zero_mm``, in m, and ``scale``."""
    return section.number("zero_mm", 0, 255) / 1000, section.number("scale", 0.5, 2, 1)


def read_settling(section: Section) -> RestCriterion:
    """The ``[settling]`` table, save ``samples``."""
    return RestCriterion(
        window=section.number("window_s", 0.05, 10, 0.3),
        swing=math.radians(section.number("swing_deg", 0.05, 20, 0.5)),
        drift=math.radians(section.number("drift_deg", 0.01, 20, 0.1)),
        timeout=section.number("timeout_s", 0.1, 60, 5),
        rate=section.number("rate_hz", 1, 1000, 50),
    )
