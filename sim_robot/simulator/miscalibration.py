"""Electronics that are not what their configuration says, by a seed.

A servo sits on its spline a few teeth off and turns the other way, an axis of the accelerometer
points down, a gauge is glued on the wrong side, the distance sensor sits deeper than drawn: all
that a person finds out by measuring.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import Final, cast

import numpy as np

from robot.configuration.joint_calibration import DrivenJoint, JointScale
from robot.configuration.robot_config import RobotConfig
from robot.drivers.sensors.analogue import StrainGauge
from robot.drivers.sensors.contracts import SensorSettings
from robot.sensing.sensors import TouchPoint

COUNTS_OFF: Final = 15 / 255  # share of all counts, at most, either way
JOINT_GAIN: Final = 0.1  # share of the true one, at most, either way; and so on
AXIS_OFF: Final = MappingProxyType({"V": 0.3, "g": 0.08})
AXIS_GAIN: Final = MappingProxyType({"V": 0.2, "g": 0.03})
TARE_VOLTS_OFF: Final = 0.3
BRIDGE_GAIN: Final = 0.5
ZERO_OFF: Final = 0.006  # m
RULER_GAIN: Final = 0.04


def miscalibrated(config: RobotConfig, seed: int) -> RobotConfig:
    """The electronics as they really are, where ``config`` is what the daemon believes."""
    rng = np.random.default_rng(seed)
    axes, distance = config.axes, config.distance
    assert axes is not None
    joints = tuple(_joint(joint, rng) for joint in config.joints)
    axes = replace(
        axes,
        zero=tuple(zero + _off(rng, AXIS_OFF[axes.unit]) for zero in axes.zero),
        per_g=tuple(gain * _gain(rng, AXIS_GAIN[axes.unit]) * _sign(rng) for gain in axes.per_g),
    )
    touch = tuple(replace(point, driver=_gauge(config, point, rng)) for point in config.touch)
    if distance is not None:
        sensor = distance.sensor
        zero = max(0.0, sensor.zero + _off(rng, ZERO_OFF))
        scale = sensor.scale * _gain(rng, RULER_GAIN)
        distance = replace(distance, sensor=replace(sensor, zero=zero, scale=scale))
    return replace(
        config,
        joints=joints,
        accelerometer=cast(SensorSettings, axes),
        touch=touch,
        distance=distance,
    )


def _gauge(config: RobotConfig, point: TouchPoint, rng: np.random.Generator) -> StrainGauge:
    gauge = config.gauges[point.name]
    return replace(
        gauge,
        tare=gauge.tare + _off(rng, TARE_VOLTS_OFF),
        volts_per_newton=gauge.volts_per_newton * _gain(rng, BRIDGE_GAIN) * _sign(rng),
    )


def _joint(joint: DrivenJoint, rng: np.random.Generator) -> DrivenJoint:
    """The same joint with its line of counts shifted, stretched and perhaps turned round."""
    (low, start), (high, end) = joint.scale.points[0], joint.scale.points[-1]
    counts = joint.scale.counts
    middle = (low + high) / 2 + _off(rng, COUNTS_OFF * len(counts))
    slope = (end - start) / (high - low) * _gain(rng, JOINT_GAIN) * _sign(rng)
    points = tuple(
        (float(count), (start + end) / 2 + slope * (count - middle))
        for count in (counts[0], counts[-1])
    )
    return replace(joint, scale=JointScale(points, counts))


def _off(rng: np.random.Generator, most: float) -> float:
    return float(rng.uniform(-most, most))


def _gain(rng: np.random.Generator, most: float) -> float:
    return 1.0 + _off(rng, most)


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice((-1.0, 1.0)))
