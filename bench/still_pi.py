"""As ``bench.still_robot``, with the chips on an I²C bus: PCA9685, ADS1115, MPU-6050, VL6180X."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Final

from bench.still_robot import Bystander, StillWorld, example_config
from robot.configuration.joint_calibration import JointScale
from robot.configuration.robot_config import RobotConfig
from robot.control.controller import Controller
from robot.drivers.ads1115 import ADS1115Settings
from robot.drivers.analogue_sensors import StrainGauge
from robot.drivers.buses import Buses
from robot.drivers.mpu6050 import MPU6050Settings
from robot.drivers.pca9685 import PCA9685Settings
from robot.drivers.servo_bus import ServoBus
from robot.host.clock import Clock, WatchedClock
from robot.service.daemon import build_controller
from robot.service.devices import open_devices
from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.clock import HostClock
from sim_robot.electronics.i2c_bus import I2CBus
from sim_robot.electronics.mpu6050 import MPU6050Emulator
from sim_robot.electronics.pca9685 import PCA9685Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from sim_robot.faults.fault_panel import FaultPanel

_ENDS: Final = (106, 509)  # counts at the limits of each joint


@dataclass(kw_only=True)
class StillPi:
    """The robot, and the parts behind it."""

    config: RobotConfig
    controller: Controller
    servos: ServoBus
    panel: FaultPanel
    pwm: PCA9685Emulator


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
        accelerometer=MPU6050Settings(
            bus=1,
            address=0x68,
            mounting=("x", "y", "z"),
            zero=(0.0, 0.0, 0.0),
            per_g=(1.0, 1.0, 1.0),
        ),
    )


@contextmanager
def still_pi(clock: Clock, *, housekeeping: float | None, log: logging.Logger) -> Iterator[StillPi]:
    """Builds the robot, with its servos on in the zero pose; its control loop is not started."""
    with ExitStack() as stack:
        config = pi_config()
        assert config.distance is not None
        world = StillWorld(volts=[0.2] * 4, distance_mm=config.distance.sensor.zero * 1000)
        pwm = PCA9685Emulator(clock)
        adc = ADS1115Emulator(world.input, clock)
        accelerometer = MPU6050Emulator(lambda: (0.0, 0.0, 1.0), clock)
        distance = VL6180XEmulator(lambda: world.distance_mm, clock)
        bus = I2CBus([pwm, adc, accelerometer, distance], clock)

        def look() -> None:
            panel.advance()

        host = HostClock(WatchedClock(clock, look))
        panel = FaultPanel(
            {"pwm": pwm, "adc": adc, "accelerometer": accelerometer, "clock": host}, host.now
        )
        stack.callback(panel.close)
        devices = open_devices(config, Buses(clock=host, open_i2c=lambda path: bus))
        stack.callback(devices.close)
        devices.servos.read_counts([joint.output for joint in config.joints])
        devices.servos.set_counts({joint.output: joint.quantise(0.0) for joint in config.joints})
        controller = build_controller(
            config,
            devices,
            clock=host,
            attendant=Bystander(panel),
            housekeeping=housekeeping,
            log=log,
        )
        yield StillPi(
            config=config, controller=controller, servos=devices.servos, panel=panel, pwm=pwm
        )
