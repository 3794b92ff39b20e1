"""Electronics with DYNAMIXEL servos on a serial line, beside the sensors of a Raspberry Pi."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final, cast

from robot.configuration.robot_config import RobotConfig
from robot.drivers.servos.answering_servos import AnsweringServos
from robot.drivers.servos.dynamixel import COUNTS, DynamixelSettings
from robot.drivers.servos.servo_bus import ServoBus
from robot.host.clock import Clock
from sim_robot.electronics.dynamixel import TICKS, DynamixelEmulator
from sim_robot.electronics.fault_switch import FaultSwitch
from sim_robot.electronics.serial_device import Follower
from sim_robot.electronics.servos import Felt
from sim_robot.simulator.pi_set import PiSensors
from sim_robot.simulator.pi_set import configure as configure_sensors
from sim_robot.simulator.wiring import Wiring
from sim_robot.world.body import Body
from sim_robot.world.sensor_noise import NoiseLevels

BAUD: Final = 1_000_000
TURN: Final = 2 * math.pi * len(COUNTS) / TICKS
"""Over all counts, rad."""


def configure(body: Body, *, port: str, levels: NoiseLevels) -> RobotConfig:
    """The configuration that fits this set.

    Args:
        body: The body.
        port: The emulated servos' serial port.
        levels: Noise, announced to clients.
    """
    servos = DynamixelSettings(port=port, baud=BAUD)
    return configure_sensors(body, levels, servos, turn=TURN)


class DynamixelSet(PiSensors):
    """A servo for each joint, with the ids from 1."""

    summary = "DYNAMIXEL X servos on a serial line, the sensors of pi on I²C"

    def __init__(self, body: Body) -> None:
        super().__init__(body)
        self.servos = DynamixelEmulator(range(1, len(body.motors) + 1), baud=BAUD)

    @property
    def switches(self) -> Mapping[str, FaultSwitch]:
        """The servos with their line, and the sensors."""
        return {"dynamixel": self.servos, **super().switches}

    def configure(self, levels: NoiseLevels) -> RobotConfig:
        """The configuration that fits, on the emulated port."""
        return configure(self._body, port=self.servos.port, levels=levels)

    def connect(self, wiring: Wiring, clock: Clock) -> None:
        """Makes the emulators of the sensors, and gives the servos the world's time."""
        super().connect(wiring, clock)
        self.servos.connect(clock)

    def pulses(self) -> Sequence[int]:
        """Where each servo drives to."""
        return self.servos.pulses()

    def feel(self, find: Callable[[], Sequence[Felt]]) -> None:
        """Tells the servos where the world has their joints."""
        self.servos.feel(find)

    def follow(self, servos: ServoBus) -> Callable[[], None]:
        """Waits for the thread that reads the serial line."""
        return Follower(self.servos, cast(AnsweringServos, servos))

    def close(self) -> None:
        """Removes the serial port."""
        self.servos.close()
