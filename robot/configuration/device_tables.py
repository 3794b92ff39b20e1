"""The tables that describe joints, sensors and their calibration in a file of the robot.

``robot.toml`` and the calibration file use the same keys for the same things; this module reads
them. Degrees and millimetres in a file, because a person writes it; radians and metres in the
objects.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Final, cast

from robot.configuration.joint_calibration import DrivenJoint, JointScale, slopes
from robot.drivers.registry import SENSORS, read_settings
from robot.drivers.sensors.contracts import (
    BoardSettings,
    CalibratedAxes,
    DistanceSettings,
    SensorSettings,
)
from robot.drivers.servos.servo_bus import ServoSettings
from robot.sensing.samples import LEAST_SAMPLES, RestCriterion
from robot.sensing.sensors import BellySensor, TouchPoint
from robot.toml_sections import Section
from robot.uncertainty import Uncertainty

JOINT_SIGMAS: Final = ("zero_sigma_deg", "travel_sigma")
AXES_SIGMAS: Final = ("zero_sigma_deg", "gain_sigma")
DISTANCE_SIGMAS: Final = ("zero_sigma_mm", "scale_sigma")
"""Keys of a table's standard deviations: of the zero, and of the gain, as a fraction."""

_SHORTEST_RANGE: Final = 10.0
"""Degrees from the lower limit to the upper one; a joint typed in radians spans six at most."""


def check_count(root: Section, head: Section, key: str, table: str, least: int) -> None:
    """Checks that as many tables follow as ``[robot]`` says: a file may have lost its end."""
    stated = head.integer(key, least, 32)
    table_count = len(root.tables(table)) if root.has(table) else 0
    if stated != table_count:
        raise head.refuse(
            key, f"says {stated}, but {table_count} [[{table}]] tables follow; lost the end?"
        )


def read_joint(section: Section, servos: ServoSettings) -> DrivenJoint:
    """Reads a ``[[joint]]`` table."""
    lower, upper = read_limits(section)
    output = section.integer("output", 0, 10_000)
    if output not in servos.outputs:
        raise section.refuse(
            "output",
            f"is {output}, and the servos ({servos.name}: {servos}) have outputs "
            f"{servos.outputs[0]} to {servos.outputs[-1]}.",
        )
    joint = DrivenJoint(
        name=section.text("name"),
        output=output,
        lower_limit=lower,
        upper_limit=upper,
        part_radius=section.number("part_radius_mm", 1, 200) / 1000,
        counts=servos.counts,
        scale=read_scale(section, servos.known_counts),
        uncertainty=Uncertainty.read(section, *JOINT_SIGMAS),
    )
    try:
        joint.check_zero()
    except ValueError as error:
        raise section.refuse("calibration", f"{error}.") from error
    section.done()
    return joint


def read_limits(section: Section) -> tuple[float, float]:
    """Reads ``limits_deg``, returned in rad."""
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


def read_scale(section: Section, counts: range) -> JointScale:
    """Reads ``calibration``, pairs of degrees and a count out of ``counts``."""
    pairs = section.pairs("calibration")
    least_slope, most_slope = slopes(counts)
    try:
        scale = JointScale(tuple((count, math.radians(angle)) for count, angle in pairs))
    except ValueError as error:
        raise section.refuse("calibration", f"{error}.") from error
    first, last = scale.points[0][0], scale.points[-1][0]
    if first < counts[0] or last > counts[-1]:
        raise section.refuse("calibration", f"counts must lie in {counts[0]} to {counts[-1]}.")
    for (count, angle), (next_count, next_angle) in pairwise(sorted(pairs)):
        slope = abs((next_angle - angle) / (next_count - count))
        if not least_slope <= slope <= most_slope:
            raise section.refuse(
                "calibration",
                f"has {slope:.3g} degrees a count from count {count:g} to {next_count:g}, and a "
                f"servo has {least_slope:.3g} to {most_slope:.3g}; write [count, degrees].",
            )
    return scale


def read_board(section: Section) -> BoardSettings:
    """Reads the ``[daq]`` table."""
    board: BoardSettings = read_settings(section, SENSORS, "dmm32", kind="daq")
    section.done()
    return board


def read_accelerometer(section: Section) -> SensorSettings:
    """Reads the ``[accelerometer]`` table."""
    driver: SensorSettings = read_settings(section, SENSORS, "analogue", kind="accelerometer")
    if isinstance(driver, CalibratedAxes):
        calibrated = replace(driver, uncertainty=Uncertainty.read(section, *AXES_SIGMAS))
        driver = cast(SensorSettings, calibrated)
    section.done()
    return driver


def read_touch(section: Section) -> TouchPoint:
    """Reads a ``[[touch]]`` table."""
    driver: SensorSettings = read_settings(section, SENSORS, "analogue", kind="touch")
    on, off = read_thresholds(section)
    point = TouchPoint(
        name=section.text("name"),
        driver=driver,
        on=on,
        off=off,
        debounce=section.integer("debounce", 1, 100, 3),
    )
    section.done()
    return point


def read_thresholds(section: Section) -> tuple[float, float]:
    """Reads ``on_n`` and ``off_n``, N."""
    on = section.number("on_n", 0, 50, 0.1)
    off = section.number("off_n", 0, 50, on / 2)
    if off > on:
        raise section.refuse("off_n", f"must not exceed on_n ({on:g}), not {off:g}.")
    return on, off


def read_distance(section: Section) -> BellySensor:
    """Reads the ``[distance]`` table."""
    driver: DistanceSettings = read_settings(section, SENSORS, "vl6180x", kind="distance")
    zero, scale = read_distance_calibration(section)
    reach = section.number("range_mm", 20, driver.reach * 1000) / 1000
    uncertainty = Uncertainty.read(section, *DISTANCE_SIGMAS)
    section.done()
    return BellySensor(driver=driver, zero=zero, scale=scale, reach=reach, uncertainty=uncertainty)


def read_distance_calibration(section: Section) -> tuple[float, float]:
    """Reads ``zero_mm``, returned in m, and ``scale``."""
    return section.number("zero_mm", 0, 255) / 1000, section.number("scale", 0.5, 2, 1)


def read_settling(section: Section) -> RestCriterion:
    """Reads the ``[settling]`` table, save ``samples``."""
    defaults = RestCriterion()
    return RestCriterion(
        window=section.number("window_s", 0.05, 10, defaults.window),
        swing=math.radians(section.number("swing_deg", 0.05, 20, math.degrees(defaults.swing))),
        drift=math.radians(section.number("drift_deg", 0.01, 20, math.degrees(defaults.drift))),
        timeout=section.number("timeout_s", 0.1, 60, defaults.timeout),
        rate=section.number("rate_hz", 1, 1000, defaults.rate),
    )


def check_rest(section: Section, criterion: RestCriterion) -> None:
    """Checks that the ``[settling]`` table lets a still robot come to rest."""
    window, timeout = criterion.window, criterion.timeout
    if window * criterion.rate < LEAST_SAMPLES:
        raise section.refuse(
            "rate_hz",
            f"must be at least {math.ceil(LEAST_SAMPLES / window)}, not {criterion.rate:g}: rest "
            f"is judged by {LEAST_SAMPLES} samples or more within window_s ({window:g}).",
        )
    if window > timeout:
        raise section.refuse(
            "window_s",
            f"must be at most {timeout:g}, not {window:g}: no robot could come to rest within "
            "timeout_s.",
        )
