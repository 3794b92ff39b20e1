"""The electronics of 2006: SV203 on a serial line, DMM-32 on I/O ports, and VL6180X."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final, cast

from robot.configuration.robot_config import RobotConfig
from robot.drivers.buses import Buses
from robot.drivers.sensors.analogue import AnalogueAxes
from robot.drivers.sensors.dmm32 import DMM32Settings
from robot.drivers.servos.servo_bus import ServoBus
from robot.drivers.servos.sv203 import SERVOS, SV203, SV203Settings
from robot.host.clock import Clock
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.fault_switch import FaultSwitch
from sim_robot.electronics.i2c_bus import I2CBus
from sim_robot.electronics.serial_device import Follower
from sim_robot.electronics.sv203 import SV203Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from sim_robot.simulator.electronics_set import REACH_MM, ElectronicsSet, configuration
from sim_robot.simulator.wiring import Wiring
from sim_robot.world.body import Body
from sim_robot.world.sensor_noise import NoiseLevels

ZERO_VOLTS: Final = 2.5  # an ADXL203-like part on 5 V
VOLTS_PER_G: Final = 1.0
AXES_INPUTS: Final = (0, 1, 2)
FIRST_FOOT: Final = 3
FULL_LOAD_VOLTS: Final = 4.0  # of an input range of 5 V


def servo_boards(body: Body) -> tuple[int, ...]:
    """Numbers of the servo boards, as many as the joints of a body need."""
    return tuple(range(1, math.ceil(len(body.motors) / SERVOS) + 1))


def configure(body: Body, *, port: str, levels: NoiseLevels) -> RobotConfig:
    """The configuration that fits this set.

    Args:
        body: The body.
        port: Serial port of the emulated servo boards.
        levels: Levels of noise that are announced to clients.
    """
    return configuration(
        body,
        levels,
        servos=SV203Settings(port=port, baud=9600, boards=servo_boards(body), line_gap=0.003),
        daq=DMM32Settings(base=0x300, input_range="±5V"),
        accelerometer=AnalogueAxes(
            channels=AXES_INPUTS, zero=(ZERO_VOLTS,) * 3, per_g=(VOLTS_PER_G,) * 3
        ),
        first_foot=FIRST_FOOT,
        full_load=FULL_LOAD_VOLTS,
    )


class PC104Set(ElectronicsSet):
    """An SV203 for every eight joints, a DMM-32 and a VL6180X."""

    summary = "the boards of 2006, on a serial line and I/O ports"

    def __init__(self, body: Body) -> None:
        super().__init__(body)
        self.servo_board = SV203Emulator(boards=servo_boards(body))

    @property
    def switches(self) -> Mapping[str, FaultSwitch]:
        """Servo board, analogue inputs, distance sensor and its bus."""
        return {
            "servo_board": self.servo_board,
            "daq": self.daq,
            "distance": self.distance,
            "i2c": self.bus,
        }

    def configure(self, levels: NoiseLevels) -> RobotConfig:
        """The configuration that fits the set, on the emulated port."""
        return configure(self._body, port=self.servo_board.port, levels=levels)

    def connect(self, wiring: Wiring, clock: Clock) -> None:
        """Makes the emulators of the sensors."""
        self.daq = DMM32Emulator(wiring.volts, clock)
        self.distance = VL6180XEmulator(wiring.distance_mm, clock, reach_mm=REACH_MM)
        self.bus = I2CBus([self.distance], clock)

    def buses(self, clock: Clock) -> Buses:
        """A real serial line; emulated I/O ports and I²C bus."""
        return Buses(clock=clock, open_ports=lambda base: self.daq, open_i2c=self.bus.open)

    def pulses(self) -> Sequence[int]:
        """Counts at the boards' outputs."""
        return self.servo_board.pulses()

    def follow(self, servos: ServoBus) -> Callable[[], None]:
        """Returns what waits for the thread that reads the serial line."""
        return Follower(self.servo_board, cast(SV203, servos))

    def close(self) -> None:
        """Removes the serial port."""
        self.servo_board.close()
