"""From the world to the electronics: what each wire of the simulated robot carries.

With a seed, the electronics are not what their configuration says: a servo sits on its spline a few
teeth off and turns the other way, an axis of the accelerometer points down, a gauge is glued on the
wrong side, the distance sensor sits deeper than drawn: all that calibration has to find out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Final, cast

import numpy as np

from robot.configuration.joint_calibration import DrivenJoint, JointScale
from robot.configuration.robot_config import RobotConfig
from robot.drivers.sensors.analogue import AnalogueAxes, StrainGauge
from robot.drivers.sensors.contracts import SensorSettings
from robot.sensing.sensors import TouchPoint
from sim_robot.electronics.sensors import Sensors
from sim_robot.electronics.servos import Servos
from sim_robot.world.sensor_noise import Noise
from sim_robot.world.simulation import World

# The largest errors of a miscalibrated robot, either way, each drawn uniformly. Those of g follow
# the MPU-6050's data sheet; the others are not tuned: a careless builder's, as we suppose.
COUNTS_OFF: Final = 15 / 255
"""Offset of a joint, as a share of all its counts."""
JOINT_GAIN: Final = 0.1
"""Relative error of a joint's degrees per count."""
AXIS_OFF: Final = MappingProxyType({"V": 0.3, "g": 0.08})
"""Offset of an axis of the accelerometer, by its unit."""
AXIS_GAIN: Final = MappingProxyType({"V": 0.2, "g": 0.03})
"""Relative error of an axis of the accelerometer, by its unit."""
TARE_OFF: Final = 0.3
"""Offset of a strain gauge, V."""
BRIDGE_GAIN: Final = 0.5
"""Relative error of a strain gauge."""
ZERO_OFF: Final = 0.006
"""Error of how deep the distance sensor sits in the belly, m."""
RULER_GAIN: Final = 0.04
"""Relative error of the distance sensor."""


class Wiring:
    """Volts and distances at the emulated electronics, computed from the world, with noise.

    Args:
        truth: How the electronics are really calibrated, whatever the daemon believes.
        world: The world.
        noise: The sensors' noise.

    Attributes:
        servos: Between the board's outputs and the joints.
        sensors: Between the body and the inputs.
    """

    def __init__(self, truth: RobotConfig, world: World, noise: Noise):
        self.servos = Servos(max(joint.output for joint in truth.joints))
        self.sensors = Sensors(len(truth.gauges))
        assert truth.distance is not None
        assert truth.axes is not None
        inputs = [gauge.channel for gauge in truth.gauges.values()]
        if isinstance(truth.axes, AnalogueAxes):
            inputs = [*truth.axes.channels, *inputs]
        self._world = world
        self._noise = noise
        self._scales = [joint.scale for joint in truth.joints]
        self._axes = truth.axes
        self._bridges = list(truth.gauges.values())
        self._belly = truth.distance.sensor
        self._inputs = inputs
        self._read_at = -1
        self._volts: dict[int, float] = {}

    def drive(self, pulses: Sequence[int]) -> None:
        """Passes counts, one for each joint, on to the servos; 0 is limp."""
        carried = self.servos.carry(pulses)
        self._world.set_targets(
            [
                self.servos.turned(index, scale.angle(count)) if count else None
                for index, (scale, count) in enumerate(zip(self._scales, carried, strict=False))
            ]
        )

    def volts(self, channel: int) -> float:
        """Volts at an analogue input; inputs with nothing on them read 0."""
        if channel in self._inputs[:1] or self._read_at != self._world.steps:
            self._read_at = self._world.steps
            dither = self._noise.dither()
            analogue = self.acceleration() if isinstance(self._axes, AnalogueAxes) else []
            values = [value + dither for value in (*analogue, *self._gauges())]
            self._volts = dict(zip(self._inputs, values, strict=True))
        return self._volts.get(channel, 0.0)

    def distance_mm(self) -> float | None:
        """The distance in front of the distance sensor, mm; ``None`` out of its range."""
        ray = self._world.belly_ray()
        if math.isinf(ray):
            return None
        measured = (ray + self._noise.clearance()) / self._belly.scale
        return (measured + self._belly.zero) * 1000 + self.sensors.too_high

    def acceleration(self) -> list[float]:
        """What the accelerometer reads along x, y and z of the body, in its unit."""
        x, y, z = self._world.up()
        turned = map(math.radians, self.sensors.turned)
        left_right, forward_back = map(sum, zip(self._noise.tilt(), turned, strict=True))
        x, y = _turned(x, forward_back), _turned(y, left_right)
        z = math.copysign(math.sqrt(max(0.0, 1 - x * x - y * y)), z)
        axes = zip(self._axes.zero, self._axes.per_g, (x, y, z), strict=True)
        return [zero + gain * value for zero, gain, value in axes]

    def _gauges(self) -> list[float]:
        return [
            bridge.tare
            + bridge.volts_per_newton * (self.sensors.load(index, load) + self._noise.load())
            for index, (bridge, load) in enumerate(
                zip(self._bridges, self._world.loads(), strict=True)
            )
        ]


def _turned(component: float, error: float) -> float:
    angle = math.asin(max(-1.0, min(1.0, component))) + error
    return math.sin(max(-math.pi / 2, min(math.pi / 2, angle)))


def miscalibrated(config: RobotConfig, seed: int) -> RobotConfig:
    """The true calibration of electronics that differ from their configuration.

    Args:
        config: What the daemon believes.
        seed: Decides the errors.
    """
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
        tare=gauge.tare + _off(rng, TARE_OFF),
        volts_per_newton=gauge.volts_per_newton * _gain(rng, BRIDGE_GAIN) * _sign(rng),
    )


def _joint(joint: DrivenJoint, rng: np.random.Generator) -> DrivenJoint:
    """A joint with its line of counts shifted, stretched and perhaps turned round."""
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
