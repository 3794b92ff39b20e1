"""The robot that ``estimator doctor --problem`` supposes where none is given."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from estimator.body.mounts import Vector
from estimator.problem.problem import Problem
from protocol.wire.capabilities import MODALITIES, Capabilities, Joint, Sensor

PAPERS_SIZE: Final = (0.14, 0.14, 0.085)
"""Extents of the paper's main body, m."""

_DENSITY: Final = 0.6 / math.prod(PAPERS_SIZE)  # kg/m³; the paper's main body has 0.6 kg
_RATE: Final = 50.0  # samples per second of a sensor that is supposed
_SENSORS: Final = {
    "tilt": Sensor(modality="tilt", unit="rad", count=2, noise=math.radians(0.3), rate=_RATE),
    "clearance": Sensor(modality="clearance", unit="m", count=1, noise=1e-3, rate=_RATE, upper=0.2),
}


def supposed_robot(problem: Problem) -> Capabilities:
    """A robot that a problem suits, where none is known, with all sensors."""
    robot = problem.supposed
    names = robot.names or tuple(f"joint {number}" for number in range(1, robot.joints + 1))
    touch = problem.sensors if problem.touch is None else robot.touch_sensors
    size = _main_body(problem)
    return with_sensors(
        Capabilities(
            robot="supposed",
            software="none",
            config_hash="none",
            base_size=size,
            base_mass=_DENSITY * math.prod(size),
            part_radii=None,
            joints=tuple(
                Joint(name=name, lower=-math.pi / 2, upper=math.pi / 2, speed=1.05, resolution=0.01)
                for name in names
            ),
            sensors=(),
            telemetry="*",
            telemetry_rate=1.0,
        ),
        touch,
    )


def with_sensors(robot: Capabilities, touch: int) -> Capabilities:
    """The robot with sensors added that it lacks, of usual noise; ``touch`` feet if it has none."""
    sensors = dict(_SENSORS)
    if touch:
        sensors["touch"] = Sensor(modality="touch", unit="bool", count=touch, noise=0.0, rate=_RATE)
    sensors |= {sensor.modality: sensor for sensor in robot.sensors}
    return replace(robot, sensors=tuple(sensors[name] for name in MODALITIES if name in sensors))


def _main_body(problem: Problem) -> Vector:
    """Extents, m, of a main body that fits the problem's mounts; without any the paper's.

    Where mounts lie on both sides of the middle, the body reaches to the outermost; it is as flat
    as the paper's, or as high as its mounts.
    """
    places = [*(mount.at for mount in problem.mounts), *(part.at for part in problem.parts)]
    points = np.array([place for place in places if isinstance(place, tuple)])
    if not points.size:
        return PAPERS_SIZE
    ends = np.round([-points.min(axis=0), points.max(axis=0)], 6)
    x, y, _ = np.where(ends.min(axis=0) > 0, 2 * ends.max(axis=0), 0.0).tolist()
    x, y = x or y or PAPERS_SIZE[0], y or x or PAPERS_SIZE[1]
    flat = math.sqrt(x * y) * PAPERS_SIZE[2] / PAPERS_SIZE[0]
    return x, y, max(flat, 2 * float(ends[:, 2].max()))
