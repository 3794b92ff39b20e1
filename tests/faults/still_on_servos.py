"""A robot on emulated serial bus servos, in a world that never moves."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from typing import Any, Final, cast

from bench.still_robot import OnElectronics, on_pi_sensors, pi_config
from robot.configuration.joint_calibration import JointScale
from robot.drivers.servos.answering_servos import AnsweringServos
from robot.drivers.servos.dynamixel import DynamixelSettings
from robot.drivers.servos.feetech import FeetechSettings
from robot.drivers.servos.servo_bus import ServoSettings
from robot.host.clock import Clock
from sim_robot.electronics.bus_servos import STEPS, BusServos
from sim_robot.electronics.dynamixel import DynamixelEmulator
from sim_robot.electronics.feetech import FeetechEmulator

_TURN: Final = math.tau * (STEPS - 1) / STEPS  # over all counts of a servo, rad


@dataclass(frozen=True, kw_only=True)
class StillOnServos(OnElectronics):
    """A robot with serial bus servos, ADS1115, MPU-6050 and VL6180X, and the servos' line."""

    servos: AnsweringServos
    line: BusServos[Any]


@contextmanager
def still_on_servos(
    family: str, clock: Clock, *, housekeeping: float | None, log: logging.Logger
) -> Iterator[StillOnServos]:
    """Builds the robot on ``feetech`` or ``dynamixel`` servos, which stand in the zero pose."""
    ids = range(1, 9)
    settings: ServoSettings
    line: BusServos[Any]
    with ExitStack() as stack:
        if family == "feetech":
            line = stack.enter_context(closing(FeetechEmulator(ids)))
            settings = FeetechSettings(port=line.port, baud=1_000_000)
        else:
            line = stack.enter_context(closing(DynamixelEmulator(ids)))
            settings = DynamixelSettings(port=line.port, baud=1_000_000)
        line.connect(clock)
        counts = settings.counts
        points = ((counts[0], -_TURN / 2), (counts[-1], _TURN / 2))
        robot, _ = stack.enter_context(
            on_pi_sensors(
                pi_config(settings, lambda joint: JointScale(points)),
                clock,
                family,
                line,
                housekeeping=housekeeping,
                log=log,
            )
        )
        servos = cast(AnsweringServos, robot.devices.servos)
        yield StillOnServos(**vars(robot), servos=servos, line=line)
