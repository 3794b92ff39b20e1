"""From the world to the electronics: what each wire of the simulated robot carries."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robot.configuration.robot_config import RobotConfig
from robot.drivers.sensors.analogue import AnalogueAxes
from sim_robot.world.sensor_noise import Noise
from sim_robot.world.simulation import World


class Wiring:
    """Volts and distances at the emulated electronics, computed from the world, with noise.

    Args:
        truth: How the electronics are really calibrated, whatever the daemon believes.
        world: The world.
        noise: The sensors' noise.
    """

    def __init__(self, truth: RobotConfig, world: World, noise: Noise):
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
        self._seen = -1
        self._volts: dict[int, float] = {}

    def drive(self, pulses: Sequence[float]) -> None:
        """Passes counts, one for each joint, on to the servos; 0 is limp."""
        self._world.set_targets(
            [
                scale.angle(count) if count else None
                for scale, count in zip(self._scales, pulses, strict=False)
            ]
        )

    def volts(self, channel: int) -> float:
        """Volts at an analogue input; inputs with nothing on them read 0."""
        if channel in self._inputs[:1] or self._seen != self._world.steps:
            self._seen = self._world.steps
            dither = self._noise.dither()
            analogue = self.acceleration() if isinstance(self._axes, AnalogueAxes) else []
            values = [value + dither for value in (*analogue, *self._gauges())]
            self._volts = dict(zip(self._inputs, values, strict=True))
        return self._volts.get(channel, 0.0)

    def distance_mm(self) -> float | None:
        """What the distance sensor is exposed to, mm; ``None`` beyond its sight."""
        ray = self._world.belly_ray()
        if math.isinf(ray):
            return None
        seen = (ray + self._noise.clearance()) / self._belly.scale
        return (seen + self._belly.zero) * 1000

    def acceleration(self) -> list[float]:
        """What the accelerometer reads along x, y and z of the body, in its unit."""
        x, y, z = self._world.up()
        left_right, forward_back = self._noise.tilt()
        x, y = _turned(x, forward_back), _turned(y, left_right)
        z = math.copysign(math.sqrt(max(0.0, 1 - x * x - y * y)), z)
        axes = zip(self._axes.zero, self._axes.per_g, (x, y, z), strict=True)
        return [zero + gain * value for zero, gain, value in axes]

    def _gauges(self) -> list[float]:
        return [
            bridge.tare + bridge.volts_per_newton * (load + self._noise.load())
            for bridge, load in zip(self._bridges, self._world.loads(), strict=True)
        ]


def _turned(component: float, error: float) -> float:
    angle = math.asin(max(-1.0, min(1.0, component))) + error
    return math.sin(max(-math.pi / 2, min(math.pi / 2, angle)))
