"""A robot on emulated electronics in a world that never moves: it lies flat, whatever it does.

It needs neither numpy nor PyBullet, so it shows what the daemon itself costs, and lets tests drive
the control loop with a clock of their own.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

from robot.clock import Clock
from robot.config import RobotConfig, load_config
from robot.controller import Controller
from robot.daemon import Electronics, build_controller, start_devices
from robot.drivers.sv203 import SV203, open_serial
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.sv203 import SV203Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator


@dataclass(kw_only=True)
class StillWorld:
    """What the sensors are exposed to; a test may change it.

    Attributes:
        volts: At each analogue input; an input that is not listed reads 0.
        distance_mm: In front of the distance sensor, or ``None``.
    """

    volts: list[float]
    distance_mm: float | None


@dataclass(frozen=True, kw_only=True)
class StillRobot:
    """The robot, and the parts behind it."""

    config: RobotConfig
    controller: Controller
    servos: SV203
    world: StillWorld
    servo_board: SV203Emulator
    daq: DMM32Emulator
    distance: VL6180XEmulator


def example_config(port: str) -> RobotConfig:
    """The documented ``robot.toml``, on another serial port."""
    config = load_config(Path(str(resources.files("robot") / "robot.toml")))
    return replace(config, servo_board=replace(config.servo_board, port=port))


@contextmanager
def still_robot(
    clock: Clock, *, housekeeping: float | None, log: logging.Logger
) -> Iterator[StillRobot]:
    """Builds the robot of the documented configuration; its control loop is not yet started."""
    with ExitStack() as stack:
        board = SV203Emulator()
        stack.callback(board.close)
        config = example_config(board.port)
        rest = [*config.accelerometer.zero[:2], config.accelerometer.zero[2] + 1.0]
        world = StillWorld(
            volts=rest + [gauge.tare for gauge in config.gauges],
            distance_mm=config.distance.sensor.zero * 1000 if config.distance else None,
        )

        def volts(channel: int) -> float:
            return world.volts[channel] if channel < len(world.volts) else 0.0

        daq = DMM32Emulator(volts, clock)
        distance = VL6180XEmulator(lambda: world.distance_mm, clock)
        devices = start_devices(
            config,
            Electronics(serial=open_serial(board.port), ports=daq, i2c=distance),
            clock,
        )
        stack.callback(devices.close)
        controller = build_controller(
            config, devices, clock=clock, attendant=None, housekeeping=housekeeping, log=log
        )
        yield StillRobot(
            config=config,
            controller=controller,
            servos=devices.servos,
            world=world,
            servo_board=board,
            daq=daq,
            distance=distance,
        )
