"""What no robot can be and no sensor can read: slips of a unit, and sensors gone mad.

A search would fit whatever it is given. Each function returns what is wrong, as the part of a
sentence that says so, or ``None``.
"""

from __future__ import annotations

import math
from typing import Final

from estimator.readings.observation import Observation
from protocol.wire.capabilities import Capabilities, Sensor

LENGTHS: Final = (1e-4, 10.0)
"""Of anything on a robot, m; what lies outside is a slip of the unit."""

CLEARANCES: Final = (1e-3, 100.0)
"""Ranges of distance sensors, m."""

DENSITIES: Final = (1.0, 25_000.0)
"""From a hull full of air to solid platinum, kg/m³."""

_CONTACT: Final = 0.005  # m that a belly on the ground may read below it
_OFF: Final = 5.0  # times the noise, which is a root mean square
_ROUNDING: Final = 1e-6


def implausible_body(robot: Capabilities) -> str | None:
    """What is wrong with the sizes and masses that a robot says it has."""
    low, high = LENGTHS
    sizes = [("base_size", size) for size in robot.base_size]
    for name, length in [*sizes, *(("part_radii", radius) for radius in robot.part_radii)]:
        if not low <= length <= high:
            return f"{name} holds {length:g} m, and must lie in {low:g} to {high:g} m"
    density = robot.base_mass / math.prod(robot.base_size)
    if not DENSITIES[0] <= density <= DENSITIES[1]:
        x, y, z = robot.base_size
        return (
            f"a main body of {x:g} x {y:g} x {z:g} m (base_size) with {robot.base_mass:g} kg "
            f"(base_mass) has a density of {density:.3g} kg/m³, and nothing is built outside "
            f"{DENSITIES[0]:g} to {DENSITIES[1]:g}"
        )
    sensor = robot.sensor("clearance")
    least, most = CLEARANCES
    if sensor is not None and sensor.upper is not None and not least <= sensor.upper <= most:
        return f"clearance reaches {sensor.upper:g} m, and must lie in {least:g} to {most:g} m"
    return None


def impossible_reading(found: Observation, robot: Capabilities) -> str | None:
    """What in an observation this robot cannot have taken or felt."""
    for joint, angle in zip(robot.joints, found.angles, strict=True):
        slack = joint.resolution + _ROUNDING
        if not joint.lower - slack <= angle <= joint.upper + slack:
            return (
                f"an angle of {_degrees(angle)} of joint {joint.name}, which reaches "
                f"{_degrees(joint.lower)} to {_degrees(joint.upper)}"
            )
    touch = robot.sensor("touch")
    if len(found.touch) != (touch.count if touch else 0):
        return f"{len(found.touch)} touch bits of {touch.count if touch else 0} touch sensors"
    for tilt in found.tilt:
        if tilt is not None and abs(tilt) > math.pi / 2 + _ROUNDING:
            return f"a tilt of {_degrees(tilt)}, which must lie in -90° to 90°"
    return _impossible_clearance(found, robot.sensor("clearance"))


def _impossible_clearance(found: Observation, sensor: Sensor | None) -> str | None:
    if found.clearance is None or sensor is None:
        return None
    below = max(_CONTACT, _OFF * sensor.noise)
    upper = math.inf if sensor.upper is None else sensor.upper + _ROUNDING
    if not -below <= found.clearance <= upper:
        return (
            f"a clearance of {found.clearance * 1000:.4g} mm, which must lie in "
            f"{-below * 1000:.4g} to {upper * 1000:.4g} mm"
        )
    return None


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.4g}°"
