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
from robot.drivers.sensors.analogue import AnalogueAxes, StrainGauge, SwitchSettings
from robot.drivers.sensors.contracts import SensorSettings
from robot.sensing.sensors import TouchPoint
from sim_robot.electronics.sensors import Sensors
from sim_robot.electronics.servos import Felt, Servos
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
        truth: Configuration with the true calibration, whatever the daemon believes.
        world: The world.
        noise: The sensors' noise.

    Attributes:
        servos: Servos between the board's outputs and the joints.
        sensors: Sensors between the body and the inputs.
    """

    def __init__(self, truth: RobotConfig, world: World, noise: Noise):
        self.servos = Servos(len(truth.joints))
        self.sensors = Sensors(len(truth.touch))
        self._gauges = _gauges_of(truth)
        inputs = [point.driver.channels[0] for _, point in self._gauges]
        if isinstance(truth.axes, AnalogueAxes):
            inputs = [*truth.axes.channels, *inputs]
        self._world = world
        self._noise = noise
        self._scales = [joint.scale for joint in truth.joints]
        self._axes = truth.axes
        self._feet = truth.touch
        self._closed_feet: set[int] = set()  # feet whose switch is closed
        self._belly_sensor = truth.distance
        self._inputs = inputs
        self._carried: tuple[int, ...] = ()  # last by servos without a fault
        self._read_step = -1
        self._volts: dict[int, float] = {}

    def drive(self, pulses: Sequence[int]) -> None:
        """Passes counts, one for each joint, on to the servos; 0 is limp."""
        carried, faults = self.servos.carry(pulses), self.servos.faults
        if carried == self._carried and not faults:
            return  # as nearly always: the clock moves by microseconds
        self._carried = () if faults else carried
        self._world.set_targets(
            [
                self.servos.turned(index, scale.angle(count)) if count else None
                for index, (scale, count) in enumerate(zip(self._scales, carried, strict=False))
            ]
        )

    def felt(self) -> list[Felt]:
        """Position, in counts, and share of torque of each joint's servo, as an encoder tells."""
        joints = zip(self._scales, self._world.angles(), self._world.torques(), strict=True)
        return [
            Felt(
                scale.exact(self.servos.angle_of(index, angle)),
                torque if scale.rises else -torque,
            )
            for index, (scale, angle, torque) in enumerate(joints)
        ]

    def volts(self, channel: int) -> float:
        """Volts at an analogue input; inputs with nothing on them read 0.

        A scan begins with the lowest input, and all that it reads is of one moment.
        """
        if channel == min(self._inputs, default=0) or self._read_step != self._world.steps:
            self._read_step = self._world.steps
            dither = self._noise.dither()
            analogue = self.acceleration() if isinstance(self._axes, AnalogueAxes) else []
            feet = [self._volts_at(foot, point, self._load(foot)) for foot, point in self._gauges]
            values = [value + dither for value in (*analogue, *feet)]
            self._volts = dict(zip(self._inputs, values, strict=True))
        return self._volts.get(channel, 0.0)

    def pressed(self, foot: int) -> bool:
        """Whether the switch of a foot, by its place among the touch sensors, is pressed.

        The switch has no noise, and snaps: it opens at less load than it closes at.
        """
        return self._closes(foot, self._load(foot))

    def _closes(self, foot: int, load: float) -> bool:
        point = self._feet[foot]
        if load > (point.off if foot in self._closed_feet else point.on):
            self._closed_feet.add(foot)
        else:
            self._closed_feet.discard(foot)
        return foot in self._closed_feet

    def distance(self) -> float | None:
        """The distance in front of the distance sensor, m; ``None`` out of its range."""
        millimetres = self.distance_mm()
        return None if millimetres is None else millimetres / 1000

    def distance_mm(self) -> float | None:
        """The distance in front of the distance sensor, mm; ``None`` out of its range."""
        assert self._belly_sensor is not None
        ray = self._world.belly_ray()
        if math.isinf(ray):
            return None
        measured = (ray + self._noise.clearance()) / self._belly_sensor.scale
        return (measured + self._belly_sensor.zero) * 1000 + self.sensors.too_high

    def acceleration(self) -> list[float]:
        """Readings of the accelerometer along x, y and z of the body, in its unit."""
        assert self._axes is not None
        axes = zip(self._axes.zero, self._axes.per_g, self.gravity(), strict=True)
        return [zero + gain * value for zero, gain, value in axes]

    def gravity(self) -> tuple[float, float, float]:
        """Gravity that the sensor feels along x, y and z of the body at rest, g."""
        x, y, z = self._world.up()
        turned = map(math.radians, self.sensors.turned)
        left_right, forward_back = map(sum, zip(self._noise.tilt(), turned, strict=True))
        x, y = _turned(x, forward_back), _turned(y, left_right)
        return x, y, math.copysign(math.sqrt(max(0.0, 1 - x * x - y * y)), z)

    def _load(self, foot: int) -> float:
        """Load on a foot as its sensor feels it, N."""
        return self.sensors.load(foot, self._world.loads()[foot])

    def _volts_at(self, foot: int, point: TouchPoint, load: float) -> float:
        if isinstance(gauge := point.driver, StrainGauge):
            return gauge.tare + gauge.volts_per_newton * (load + self._noise.load())
        assert isinstance(gauge, SwitchSettings)
        return gauge.pressed if self._closes(foot, load) else gauge.free


def _gauges_of(config: RobotConfig) -> list[tuple[int, TouchPoint]]:
    """Touch sensors on analogue inputs, each with its index among all touch sensors."""
    kinds = StrainGauge | SwitchSettings
    return [
        (foot, point) for foot, point in enumerate(config.touch) if isinstance(point.driver, kinds)
    ]


def _turned(component: float, error: float) -> float:
    angle = math.asin(max(-1.0, min(1.0, component))) + error
    return math.sin(max(-math.pi / 2, min(math.pi / 2, angle)))


def miscalibrated(config: RobotConfig, seed: int) -> RobotConfig:
    """The true calibration of electronics that differ from their configuration.

    Args:
        config: Configuration that the daemon believes.
        seed: Seed of the errors.
    """
    rng = np.random.default_rng(seed)
    axes, distance, accelerometer = config.axes, config.distance, config.accelerometer
    joints = tuple(_joint(joint, rng) for joint in config.joints)
    if axes is not None:
        unit = axes.unit
        axes = replace(
            axes,
            zero=tuple(zero + _off(rng, AXIS_OFF[unit]) for zero in axes.zero),
            per_g=tuple(gain * _gain(rng, AXIS_GAIN[unit]) * _sign(rng) for gain in axes.per_g),
        )
        accelerometer = cast(SensorSettings, axes)
    touch = tuple(replace(point, driver=_gauge(config, point, rng)) for point in config.touch)
    if distance is not None:
        zero = max(0.0, distance.zero + _off(rng, ZERO_OFF))
        scale = distance.scale * _gain(rng, RULER_GAIN)
        distance = replace(distance, zero=zero, scale=scale)
    return replace(
        config,
        joints=joints,
        accelerometer=accelerometer,
        touch=touch,
        distance=distance,
    )


def _gauge(config: RobotConfig, point: TouchPoint, rng: np.random.Generator) -> SensorSettings:
    gauge = config.gauges.get(point.name)
    if gauge is None:
        return point.driver  # a switch has no calibration
    return replace(
        gauge,
        tare=gauge.tare + _off(rng, TARE_OFF),
        volts_per_newton=gauge.volts_per_newton * _gain(rng, BRIDGE_GAIN) * _sign(rng),
    )


def _joint(joint: DrivenJoint, rng: np.random.Generator) -> DrivenJoint:
    """A joint with its line of counts shifted, stretched and perhaps turned round."""
    (low, start), (high, end) = joint.scale.points[0], joint.scale.points[-1]
    counts = joint.counts
    middle = (low + high) / 2 + _off(rng, COUNTS_OFF * len(counts))
    slope = (end - start) / (high - low) * _gain(rng, JOINT_GAIN) * _sign(rng)
    points = tuple(
        (float(count), (start + end) / 2 + slope * (count - middle))
        for count in (counts[0], counts[-1])
    )
    return replace(joint, scale=JointScale(points))


def _off(rng: np.random.Generator, most: float) -> float:
    return float(rng.uniform(-most, most))


def _gain(rng: np.random.Generator, most: float) -> float:
    return 1.0 + _off(rng, most)


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice((-1.0, 1.0)))
