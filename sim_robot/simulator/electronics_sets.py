"""Sets of electronics: which boards a simulated robot has, each as the configuration that fits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from robot.configuration.joint_calibration import DrivenJoint, JointScale, middle
from robot.configuration.robot_config import BodyConfig, NoiseConfig, RobotConfig
from robot.drivers.sensors.ads1115 import INPUTS_PER_CHIP, ADS1115Settings
from robot.drivers.sensors.analogue import AnalogueAxes, StrainGauge
from robot.drivers.sensors.contracts import BoardSettings, SensorSettings
from robot.drivers.sensors.dmm32 import DMM32Settings
from robot.drivers.sensors.mpu6050 import MPU6050Settings
from robot.drivers.sensors.vl6180x import VL6180XSettings
from robot.drivers.servos.answering_servos import AnsweringServoSettings
from robot.drivers.servos.dynamixel import DynamixelSettings
from robot.drivers.servos.feetech import FeetechSettings
from robot.drivers.servos.pca9685 import OSCILLATOR_MHZ, PCA9685Settings
from robot.drivers.servos.pca9685_board import OUTPUTS
from robot.drivers.servos.servo_bus import ServoSettings
from robot.drivers.servos.sv203 import SERVOS, SV203Settings
from robot.sensing.samples import RestCriterion
from robot.sensing.sensors import BellySensor, TouchPoint
from sim_robot.electronics.bus_servos import STEPS
from sim_robot.world.body import Body, Motor
from sim_robot.world.sensor_noise import NoiseLevels
from sim_robot.world.simulation import GRAVITY, SERVO_SPEED

TARE_VOLTS: Final = 0.2
"""Voltage of a strain gauge without load, V."""
VOLTS_PER_NEWTON: Final = 0.1
"""Sensitivity of a strain gauge, V/N; less for a heavy body, so that twice its weight reads."""
RECESS: Final = 0.010
"""How far inside the belly the distance sensor sits, m."""
REACH: Final = 0.2
"""The largest clearance that is measured, m."""
REACH_MM: Final = int(1000 * (REACH + RECESS))
"""The largest distance from the sensor that is measured, mm."""

ZERO_VOLTS: Final = 2.5
"""Reading of an axis of the analogue accelerometer at 0 g, V: an ADXL203-like part on 5 V."""
VOLTS_PER_G: Final = 1.0
"""Sensitivity of the analogue accelerometer, V/g."""
AXES_INPUTS: Final = (0, 1, 2)
"""Inputs of the board on the PC/104 bus to which the accelerometer's axes are connected."""
FIRST_FOOT: Final = 3
"""Input of that board to which the first strain gauge is connected; the others follow."""

ENCODER: Final = math.radians(0.05)
"""Error of a measured angle, rad: an emulated encoder of 4096 steps has neither noise nor play."""

_SPARE_SHARE: Final = 2 / 255
"""Share of the counts beyond each limit of a joint."""


def pc104(body: Body, levels: NoiseLevels) -> RobotConfig:
    """An SV203 for every eight joints, a DMM-32 and a VL6180X."""
    boards = math.ceil(len(body.motors) / SERVOS)
    return _configuration(
        body,
        levels,
        servos=SV203Settings(
            port="/dev/ttyS0", baud=9600, boards=tuple(range(1, boards + 1)), line_gap=0.003
        ),
        daq=DMM32Settings(base=0x300, input_range="±5V"),
        accelerometer=AnalogueAxes(
            channels=AXES_INPUTS, zero=(ZERO_VOLTS,) * 3, per_g=(VOLTS_PER_G,) * 3
        ),
        first_foot=FIRST_FOOT,
        full_load=4.0,  # of an input range of 5 V
    )


def pi(body: Body, levels: NoiseLevels) -> RobotConfig:
    """A PCA9685 for every sixteen joints, with 50 pulses a second, beside the sensors."""
    boards = math.ceil(len(body.motors) / OUTPUTS)
    servos = PCA9685Settings(
        bus=1,
        boards=tuple(range(0x40, 0x40 + boards)),
        prescale=121,
        widths_us=(500.0, 2500.0),
        oscillators_mhz=(OSCILLATOR_MHZ,) * boards,
    )
    return _with_sensors_of_pi(body, levels, servos)


def feetech(body: Body, levels: NoiseLevels) -> RobotConfig:
    """Feetech STS servos, with the IDs from 1, beside the sensors of a Pi."""
    return _with_sensors_of_pi(body, levels, FeetechSettings(port="/dev/ttyUSB0", baud=1_000_000))


def dynamixel(body: Body, levels: NoiseLevels) -> RobotConfig:
    """DYNAMIXEL X servos, with the IDs from 1, beside the sensors of a Pi."""
    return _with_sensors_of_pi(body, levels, DynamixelSettings(port="/dev/ttyUSB0", baud=1_000_000))


@dataclass(frozen=True)
class ElectronicsSet:
    """One set of electronics.

    Attributes:
        summary: Boards of the set, for the command line's help.
        configure: Returns the configuration that fits a body; the levels of noise are announced to
            clients.
    """

    summary: str
    configure: Callable[[Body, NoiseLevels], RobotConfig]


SETS: Final[Mapping[str, ElectronicsSet]] = MappingProxyType(
    {
        "pc104": ElectronicsSet("the boards of 2006, on a serial line and I/O ports", pc104),
        "pi": ElectronicsSet("PCA9685, ADS1115 and MPU-6050 on the I²C bus of a Raspberry Pi", pi),
        "feetech": ElectronicsSet(
            "Feetech STS servos on a serial line, the sensors of pi on I²C", feetech
        ),
        "dynamixel": ElectronicsSet(
            "DYNAMIXEL X servos on a serial line, the sensors of pi on I²C", dynamixel
        ),
    }
)
"""Sets of electronics, by the names that ``sim-robotd --electronics`` takes."""

DEFAULT_SET: Final = "pc104"


def _with_sensors_of_pi(body: Body, levels: NoiseLevels, servos: ServoSettings) -> RobotConfig:
    """As many ADS1115 as the body's feet need, an MPU-6050 and a VL6180X on one bus."""
    chips = math.ceil(len(body.touch) / INPUTS_PER_CHIP)
    return _configuration(
        body,
        levels,
        servos=servos,
        daq=ADS1115Settings(
            bus=1, addresses=tuple(range(0x48, 0x48 + chips)), input_range="±4.096V"
        )
        if chips
        else None,
        accelerometer=MPU6050Settings(bus=1, address=0x68),
        first_foot=0,
        full_load=3.0,  # of a supply of 3.3 V
    )


def _configuration(
    body: Body,
    levels: NoiseLevels,
    *,
    servos: ServoSettings,
    daq: BoardSettings | None,
    accelerometer: SensorSettings,
    first_foot: int,
    full_load: float,
) -> RobotConfig:
    """The configuration of a simulated robot with the drivers of one set.

    The emulated calibration is one rule for every body and board: a joint's range takes all counts
    but a few at either end, so that the middle count is its middle. With 255 counts that is 0.68° a
    count at the hips of the paper's quadruped and 0.76° at its knees, because Table 2's ranges do
    not fit the 254 counts at the SV203's nominal 0.71°. A count of bus servos is a step of their
    encoder, and the middle count 0°.

    Args:
        body: The body.
        levels: Levels of noise that are announced to clients.
        servos: Settings of the servos; joints are on their outputs, in order.
        daq: Settings of the board that has the feet on its inputs, or ``None``.
        accelerometer: Settings of the accelerometer.
        first_foot: Input of the first foot; the others follow.
        full_load: Largest voltage at twice the body's weight on one foot, V.
    """
    counts = servos.counts
    spare = int(len(counts) * _SPARE_SHARE)
    ends = counts[0] + spare, counts[-1] - spare

    def scale(motor: Motor) -> JointScale:
        if not isinstance(servos, AnsweringServoSettings):
            return JointScale(((ends[0], motor.lower), (ends[1], motor.upper)))
        steps = [(count, count - middle(counts)) for count in (counts[0], counts[-1])]
        return JointScale(tuple((count, 2 * math.pi / STEPS * step) for count, step in steps))

    sensitivity = min(VOLTS_PER_NEWTON, full_load / (2 * body.mass * GRAVITY))
    return RobotConfig(
        name=body.name[:64],
        body=BodyConfig(
            size=body.base_size,
            radius=body.base_radius,
            mass=body.base_mass,
            lies_flat=body.lies_flat,
        ),
        servos=servos,
        joints=tuple(
            DrivenJoint(
                name=motor.name,
                output=output,
                lower_limit=motor.lower,
                upper_limit=motor.upper,
                part_radius=motor.radius,
                counts=counts,
                scale=scale(motor),
            )
            for output, motor in zip(servos.outputs, body.motors, strict=False)
        ),
        speed=SERVO_SPEED,
        daq=daq,
        accelerometer=accelerometer,
        touch=tuple(
            TouchPoint(
                name=name,
                driver=StrainGauge(
                    channel=first_foot + index, tare=TARE_VOLTS, volts_per_newton=sensitivity
                ),
                on=0.1,
                off=0.05,
                debounce=3,
            )
            for index, name in enumerate(body.touch)
        ),
        distance=BellySensor(driver=VL6180XSettings(bus=1, address=0x29), zero=RECESS, reach=REACH),
        settling=RestCriterion(),
        samples=10,
        noise=NoiseConfig(
            tilt=levels.announced * math.radians(levels.tilt_deg),
            clearance=levels.announced * levels.clearance_mm / 1000,
            joint=ENCODER,
        ),
    )
