"""What no robot can be and no sensor can read: slips of a unit, and sensors gone mad.

A search would fit whatever it is given. Each function returns what is wrong, as the part of a
sentence that says so, or ``None``.
"""

from __future__ import annotations

import math
from typing import Final

from estimator.readings.modalities.base import ROUNDING
from estimator.readings.modalities.registry import MODALITIES
from estimator.readings.observation import Observation
from protocol.wire.capabilities import Capabilities

LENGTHS: Final = (1e-4, 10.0)
"""Of anything on a robot, m; what lies outside is a slip of the unit."""

DENSITIES: Final = (1.0, 25_000.0)
"""From a hull full of air to solid platinum, kg/m³."""


def implausible_body(robot: Capabilities) -> str | None:
    """What is wrong with the sizes and masses that a robot says it has."""
    low, high = LENGTHS
    sizes = [("base_size", size) for size in robot.base_size]
    for name, length in [*sizes, *(("part_radii", radius) for radius in robot.part_radii or ())]:
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
    for sensor in robot.sensors:
        wrong = MODALITIES[sensor.modality].wrong_sensor(sensor)
        if wrong is not None:
            return wrong
    return None


def impossible_reading(observation: Observation, robot: Capabilities) -> str | None:
    """What in an observation this robot cannot have taken or felt."""
    for joint, angle in zip(robot.joints, observation.angles, strict=True):
        slack = joint.resolution + ROUNDING
        if not joint.lower - slack <= angle <= joint.upper + slack:
            return (
                f"an angle of {_degrees(angle)} of joint {joint.name}, which reaches "
                f"{_degrees(joint.lower)} to {_degrees(joint.upper)}"
            )
    for modality in MODALITIES.values():
        wrong = modality.wrong_reading(observation, robot.sensor(modality.name))
        if wrong is not None:
            return wrong
    return None


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.4g}°"
