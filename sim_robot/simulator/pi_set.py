"""Electronics for the I²C bus of a Raspberry Pi: PCA9685, ADS1115, MPU-6050 and VL6180X."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from robot.configuration.robot_config import RobotConfig
from robot.drivers.buses import Buses
from robot.drivers.sensors.ads1115 import INPUTS_PER_CHIP, ADS1115Settings
from robot.drivers.sensors.mpu6050 import MPU6050Settings
from robot.drivers.servos.pca9685 import OSCILLATOR_MHZ, PCA9685Settings
from robot.drivers.servos.pca9685_board import OUTPUTS, TICKS
from robot.drivers.servos.servo_bus import ServoSettings
from robot.host.clock import Clock
from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.fault_switch import FaultSwitch
from sim_robot.electronics.i2c_bus import I2CBus, I2CDevice
from sim_robot.electronics.mpu6050 import MPU6050Emulator
from sim_robot.electronics.pca9685 import PCA9685Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from sim_robot.simulator.electronics_set import REACH_MM, ElectronicsSet, configuration
from sim_robot.simulator.wiring import Wiring
from sim_robot.world.body import Body
from sim_robot.world.sensor_noise import NoiseLevels

FULL_LOAD_VOLTS: Final = 3.0  # of a supply of 3.3 V
PRESCALE: Final = 121  # 50 pulses a second
WIDTHS_US: Final = (500.0, 2500.0)


def pulse_boards(body: Body) -> PCA9685Settings:
    """Settings of the servo boards that the joints of a body need."""
    boards = math.ceil(len(body.motors) / OUTPUTS)
    return PCA9685Settings(
        bus=1,
        boards=tuple(range(0x40, 0x40 + boards)),
        prescale=PRESCALE,
        widths_us=WIDTHS_US,
        oscillators_mhz=(OSCILLATOR_MHZ,) * boards,
    )


def configure(
    body: Body, levels: NoiseLevels, servos: ServoSettings, *, turn: float | None = None
) -> RobotConfig:
    """The configuration that fits these sensors.

    Args:
        body: The body.
        levels: Levels of noise that are announced to clients.
        servos: Settings of the servos.
        turn: Angle that a servo turns over all its counts, rad, as for ``configuration``.
    """
    chips = math.ceil(len(body.touch) / INPUTS_PER_CHIP)
    return configuration(
        body,
        levels,
        servos=servos,
        turn=turn,
        daq=ADS1115Settings(
            bus=1, addresses=tuple(range(0x48, 0x48 + chips)), input_range="±4.096V"
        )
        if chips
        else None,
        accelerometer=MPU6050Settings(bus=1, address=0x68),
        first_foot=0,
        full_load=FULL_LOAD_VOLTS,
    )


class PiSensors(ElectronicsSet):
    """As many ADS1115 as the body's feet need, an MPU-6050 and a VL6180X on one bus."""

    @property
    def switches(self) -> Mapping[str, FaultSwitch]:
        """Every chip, of several of a kind the first; and the bus."""
        switches: dict[str, FaultSwitch] = {
            "accelerometer": self.accelerometer,
            "distance": self.distance,
            "i2c": self.bus,
        }
        return switches | ({"adc": self.adc[0]} if self.adc else {})

    @property
    def i2c_servos(self) -> Sequence[I2CDevice]:
        """Servo boards, if they are on the bus, too."""
        return ()

    def connect(self, wiring: Wiring, clock: Clock) -> None:
        """Makes the emulators of the sensors, and the bus."""

        def inputs_from(first: int) -> Callable[[int], float]:
            return lambda channel: wiring.volts(first + channel)

        self.adc = [
            ADS1115Emulator(inputs_from(first), clock, address=0x48 + index)
            for index, first in enumerate(range(0, len(self._body.touch), INPUTS_PER_CHIP))
        ]
        self.accelerometer = MPU6050Emulator(wiring.acceleration, clock)
        self.distance = VL6180XEmulator(wiring.distance_mm, clock, reach_mm=REACH_MM)
        self.bus = I2CBus([*self.i2c_servos, *self.adc, self.accelerometer, self.distance], clock)

    def buses(self, clock: Clock) -> Buses:
        """One I²C bus, whatever its number."""
        return Buses(clock=clock, open_i2c=self.bus.open)

    def begin_interaction(self) -> None:
        """Restarts the dither of the accelerometer, which alone counts its samples."""
        self.accelerometer.restart_dither()


class PiSet(PiSensors):
    """As many PCA9685 as the body needs, beside the sensors."""

    summary = "PCA9685, ADS1115 and MPU-6050 on the I²C bus of a Raspberry Pi"

    @property
    def switches(self) -> Mapping[str, FaultSwitch]:
        """The first servo board, and the sensors."""
        return {"pwm": self.pwm[0], **super().switches}

    def configure(self, levels: NoiseLevels) -> RobotConfig:
        """The configuration that fits the set; it decides how many servo boards there are."""
        self._servos = pulse_boards(self._body)
        return configure(self._body, levels, self._servos)

    @property
    def i2c_servos(self) -> Sequence[I2CDevice]:
        """The servo boards."""
        return self.pwm

    def connect(self, wiring: Wiring, clock: Clock) -> None:
        """Makes the emulators."""
        self.pwm = [PCA9685Emulator(clock, address=address) for address in self._servos.boards]
        super().connect(wiring, clock)

    def pulses(self) -> Sequence[int]:
        """Widths that the boards command, in ticks."""
        return commanded(self._servos, self.pwm)


def commanded(settings: PCA9685Settings, boards: Sequence[PCA9685Emulator]) -> list[int]:
    """Pulse widths of all outputs in ticks of the configured length, also on a board with others.

    A level is no pulse, and a width that no servo knows drives it against its stop.
    """
    counts = settings.counts
    ticks = zip(boards, settings.ticks_us, strict=True)
    widths = [
        round(pulse % TICKS * board.tick_us / tick)
        for board, tick in ticks
        for pulse in board.pulses()
    ]
    return [min(max(width, counts[0]), counts[-1]) if width else 0 for width in widths]
