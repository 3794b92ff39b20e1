"""As ``bench.still_robot``, with the chips on an I²C bus: PCA9685, ADS1115, MPU-6050, VL6180X."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Final

from bench.still_robot import OnElectronics, StillWorld, example_config, on_electronics
from robot.configuration.joint_calibration import JointScale
from robot.configuration.robot_config import RobotConfig
from robot.drivers.buses import Buses
from robot.drivers.sensors.ads1115 import ADS1115Settings
from robot.drivers.sensors.analogue import StrainGauge
from robot.drivers.sensors.mpu6050 import MPU6050Settings
from robot.drivers.servos.pca9685 import PCA9685Settings
from robot.drivers.servos.servo_bus import ServoBus
from robot.host.clock import Clock
from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.i2c_bus import I2CBus
from sim_robot.electronics.mpu6050 import MPU6050Emulator
from sim_robot.electronics.pca9685 import PCA9685Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator

_ENDS: Final = (106, 509)  # counts at the limits of each joint


@dataclass(frozen=True, kw_only=True)
class StillPi(OnElectronics):
    """The robot, and the parts behind it."""

    servos: ServoBus
    pwm: PCA9685Emulator
    bus: I2CBus


def pi_config() -> RobotConfig:
    """The documented robot, with the chips in the place of its boards."""
    config = example_config("")
    servos = PCA9685Settings(bus=1, boards=(0x40,), prescale=121, widths_us=(500.0, 2500.0))
    joints = tuple(
        replace(
            joint,
            output=joint.output - 1,
            scale=JointScale(
                tuple(zip(_ENDS, (joint.lower_limit, joint.upper_limit), strict=True)),
                servos.counts,
            ),
        )
        for joint in config.joints
    )
    touch = tuple(
        replace(point, driver=StrainGauge(channel=index, tare=0.2, volts_per_newton=0.1))
        for index, point in enumerate(config.touch)
    )
    return replace(
        config,
        servos=servos,
        joints=joints,
        touch=touch,
        daq=ADS1115Settings(bus=1, addresses=(0x48,), input_range="±4.096V"),
        accelerometer=MPU6050Settings(bus=1, address=0x68),
    )


@contextmanager
def still_pi(clock: Clock, *, housekeeping: float | None, log: logging.Logger) -> Iterator[StillPi]:
    """Builds the robot, with its servos on in the zero pose; its control loop is not started."""
    config = pi_config()
    assert config.distance is not None
    world = StillWorld(volts=[0.2] * 4, distance_mm=config.distance.sensor.zero * 1000)
    pwm = PCA9685Emulator(clock)
    adc = ADS1115Emulator(world.input, clock)
    accelerometer = MPU6050Emulator(lambda: (0.0, 0.0, 1.0), clock)
    distance = VL6180XEmulator(lambda: world.distance_mm, clock)
    bus = I2CBus([pwm, adc, accelerometer, distance], clock)
    with on_electronics(
        config,
        {
            "pwm": pwm,
            "adc": adc,
            "accelerometer": accelerometer,
            "distance": distance,
            "i2c": bus,
        },
        Buses(clock=clock, open_i2c=bus.open),
        stand=True,
        housekeeping=housekeeping,
        log=log,
    ) as robot:
        yield StillPi(**vars(robot), servos=robot.devices.servos, pwm=pwm, bus=bus)
