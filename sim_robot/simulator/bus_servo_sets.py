"""Electronics with serial bus servos that answer, beside the sensors of a Raspberry Pi."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Final, cast

from robot.configuration.robot_config import RobotConfig
from robot.drivers.servos.answering_servos import AnsweringServos
from robot.drivers.servos.dynamixel import DynamixelSettings
from robot.drivers.servos.feetech import FeetechSettings
from robot.drivers.servos.servo_bus import ServoBus, ServoSettings
from robot.host.clock import Clock
from sim_robot.electronics.bus_servos import STEPS, BusServos
from sim_robot.electronics.dynamixel import DynamixelEmulator
from sim_robot.electronics.fault_switch import FaultSwitch
from sim_robot.electronics.feetech import FeetechEmulator
from sim_robot.electronics.serial_device import Follower
from sim_robot.electronics.servos import Felt
from sim_robot.simulator.pi_set import PiSensors, configure
from sim_robot.simulator.wiring import Wiring
from sim_robot.world.body import Body
from sim_robot.world.sensor_noise import NoiseLevels

BAUD: Final = 1_000_000


class BusServoSet(PiSensors):
    """Bus servos, one for each joint, with the IDs from 1.

    Attributes:
        name: Name of the servos at the fault panel.
    """

    name: ClassVar[str]
    lag = 0.05  # they have a top speed of their own

    def __init__(self, body: Body) -> None:
        super().__init__(body)
        self.servos = self.emulator(range(1, len(body.motors) + 1))

    @staticmethod
    @abstractmethod
    def emulator(ids: Sequence[int]) -> BusServos[Any]:
        """Emulated servos that have these IDs."""

    @staticmethod
    @abstractmethod
    def settings(port: str) -> ServoSettings:
        """Settings of the servos' driver."""

    @classmethod
    def configuration(cls, body: Body, *, port: str, levels: NoiseLevels) -> RobotConfig:
        """The configuration that fits this set.

        Args:
            body: The body.
            port: Serial port of the emulated servos.
            levels: Levels of noise that are announced to clients.
        """
        servos = cls.settings(port)
        turn = 2 * math.pi * len(servos.counts) / STEPS
        return configure(body, levels, servos, turn=turn)

    @property
    def switches(self) -> Mapping[str, FaultSwitch]:
        """The servos with their line, and the sensors."""
        return {self.name: self.servos, **super().switches}

    def configure(self, levels: NoiseLevels) -> RobotConfig:
        """The configuration that fits the set, on the emulated port."""
        return self.configuration(self._body, port=self.servos.port, levels=levels)

    def connect(self, wiring: Wiring, clock: Clock) -> None:
        """Makes the emulators of the sensors, and gives the servos the world's time."""
        super().connect(wiring, clock)
        self.servos.connect(clock)

    def pulses(self) -> Sequence[int]:
        """Position that each servo drives to, in steps."""
        return self.servos.pulses()

    def feel(self, find: Callable[[], Sequence[Felt]]) -> None:
        """Tells the servos where the world has their joints."""
        self.servos.feel(find)

    def follow(self, servos: ServoBus) -> Callable[[], None]:
        """Returns what waits for the thread that reads the serial line."""
        return Follower(self.servos, cast(AnsweringServos, servos))

    def close(self) -> None:
        """Removes the serial port."""
        self.servos.close()


class FeetechSet(BusServoSet):
    """Feetech STS servos."""

    name = "feetech"
    summary = "Feetech STS servos on a serial line, the sensors of pi on I²C"

    @staticmethod
    def emulator(ids: Sequence[int]) -> FeetechEmulator:
        """Emulated STS3215 servos."""
        return FeetechEmulator(ids, baud=BAUD)

    @staticmethod
    def settings(port: str) -> FeetechSettings:
        """Settings of the driver, at 1 Mbaud."""
        return FeetechSettings(port=port, baud=BAUD)


class DynamixelSet(BusServoSet):
    """DYNAMIXEL X servos."""

    name = "dynamixel"
    summary = "DYNAMIXEL X servos on a serial line, the sensors of pi on I²C"

    @staticmethod
    def emulator(ids: Sequence[int]) -> DynamixelEmulator:
        """Emulated XL330-M288 servos."""
        return DynamixelEmulator(ids, baud=BAUD)

    @staticmethod
    def settings(port: str) -> DynamixelSettings:
        """Settings of the driver, at 1 Mbaud."""
        return DynamixelSettings(port=port, baud=BAUD)
