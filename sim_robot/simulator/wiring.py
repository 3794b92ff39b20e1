"""From the world to the electronics: what each wire of the simulated robot carries.

The emulated calibration is one rule for every body: 250 counts span a joint's range, so count 128
is its middle. For the paper's quadruped that is 0.68° a count at the hips and 0.76° at the knees,
because Table 2's ranges do not fit the 254 counts at the board's nominal 0.71°.
"""

from __future__ import annotations

import math
from typing import Final

from robot.configuration.device_tables import DistanceConfig
from robot.configuration.joint_calibration import DrivenJoint, JointScale
from robot.configuration.robot_config import BodyConfig, NoiseConfig, RobotConfig
from robot.drivers.analogue_sensors import AnalogueAxes, StrainGauge
from robot.drivers.dmm32 import DMM32Settings
from robot.drivers.sv203 import SV203Settings
from robot.drivers.vl6180x import VL6180XSettings
from robot.sensing.sensors import BellySensor
from robot.sensing.settling import RestCriterion
from robot.sensing.touch import TouchPoint
from sim_robot.world.body import Body
from sim_robot.world.sensor_noise import Noise, NoiseLevels
from sim_robot.world.simulation import GRAVITY, SERVO_SPEED, World

ZERO_VOLTS: Final = 2.5  # an ADXL203-like part on 5 V
VOLTS_PER_G: Final = 1.0
TARE_VOLTS: Final = 0.2
VOLTS_PER_NEWTON: Final = 0.1  # less for a heavy body: twice its weight on one foot still reads
FULL_LOAD_VOLTS: Final = 4.0
FIRST_GAUGE: Final = 3
RECESS: Final = 0.010  # the distance sensor sits this far inside the belly, m
REACH: Final = 0.2


def configure(body: Body, *, port: str, levels: NoiseLevels) -> RobotConfig:
    """The configuration that fits the emulated electronics of a body.

    Args:
        body: The body.
        port: The emulated servo board's serial port.
        levels: Noise, announced to clients.
    """
    sensitivity = min(VOLTS_PER_NEWTON, FULL_LOAD_VOLTS / (2 * body.mass * GRAVITY))
    return RobotConfig(
        name=body.name[:64],
        body=BodyConfig(size=body.base_size, mass=body.base_mass),
        servos=SV203Settings(port=port, baud=9600, board=1, line_gap=0.003),
        joints=tuple(
            DrivenJoint(
                name=motor.name,
                output=number,
                lower_limit=motor.lower,
                upper_limit=motor.upper,
                part_radius=motor.radius,
                scale=JointScale(((3, motor.lower), (253, motor.upper)), SV203Settings.counts),
            )
            for number, motor in enumerate(body.motors, start=1)
        ),
        speed=SERVO_SPEED,
        daq=DMM32Settings(base=0x300, input_range="±5V"),
        accelerometer=AnalogueAxes(
            channels=(0, 1, 2), zero=(ZERO_VOLTS,) * 3, volts_per_g=(VOLTS_PER_G,) * 3
        ),
        touch=tuple(
            TouchPoint(
                name=name,
                driver=StrainGauge(
                    channel=FIRST_GAUGE + index, tare=TARE_VOLTS, volts_per_newton=sensitivity
                ),
                on=0.1,
                off=0.05,
                debounce=3,
            )
            for index, name in enumerate(body.touch)
        ),
        distance=DistanceConfig(
            driver=VL6180XSettings(bus=1, address=0x29),
            sensor=BellySensor(zero=RECESS, reach=REACH),
        ),
        settling=RestCriterion(
            window=0.3,
            swing=math.radians(0.5),
            drift=math.radians(0.1),
            timeout=5.0,
            rate=50.0,
        ),
        samples=10,
        noise=NoiseConfig(tilt=math.radians(levels.tilt_deg), clearance=levels.clearance_mm / 1000),
    )


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
        self._world = world
        self._noise = noise
        self._scales = [joint.scale for joint in truth.joints]
        self._axes = truth.axes
        self._bridges = list(truth.gauges.values())
        self._belly = truth.distance.sensor
        self._seen = -1
        self._volts: list[float] = []

    def drive(self, pulses: tuple[int, ...]) -> None:
        """Passes the board's counts on to the servos; 0 is limp."""
        self._world.set_targets(
            [
                scale.angle(count) if count else None
                for scale, count in zip(self._scales, pulses, strict=False)
            ]
        )

    def volts(self, channel: int) -> float:
        """Volts at an analogue input; inputs with nothing on them read 0."""
        if channel == 0 or self._seen != self._world.steps:
            self._seen = self._world.steps
            dither = self._noise.dither()
            self._volts = [v + dither for v in (*self._acceleration(), *self._gauges())]
        return self._volts[channel] if channel < len(self._volts) else 0.0

    def distance_mm(self) -> float | None:
        """What the distance sensor is exposed to, mm; ``None`` beyond its sight."""
        ray = self._world.belly_ray()
        if math.isinf(ray):
            return None
        seen = (ray + self._noise.clearance()) / self._belly.scale
        return (seen + self._belly.zero) * 1000

    def _acceleration(self) -> list[float]:
        x, y, z = self._world.up()
        left_right, forward_back = self._noise.tilt()
        x, y = _turned(x, forward_back), _turned(y, left_right)
        z = math.copysign(math.sqrt(max(0.0, 1 - x * x - y * y)), z)
        axes = zip(self._axes.zero, self._axes.volts_per_g, (x, y, z), strict=True)
        return [zero + gain * value for zero, gain, value in axes]

    def _gauges(self) -> list[float]:
        return [
            bridge.tare + bridge.volts_per_newton * (load + self._noise.load())
            for bridge, load in zip(self._bridges, self._world.loads(), strict=True)
        ]


def _turned(component: float, error: float) -> float:
    angle = math.asin(max(-1.0, min(1.0, component))) + error
    return math.sin(max(-math.pi / 2, min(math.pi / 2, angle)))
