"""The electronics that a configuration names, emulated: a set's, or somebody's own ``robot.toml``.

Wiring, limits and calibration are the configuration's. A device that has an emulator is emulated,
at the address, port or line that it says. A driver without an emulator is not rehearsed: a stand-in
gives what its contract promises, straight from the simulated body, and a note says so.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from typing import Any, Final, cast

from protocol.text import brief
from robot.configuration.robot_config import RobotConfig
from robot.drivers.buses import Buses
from robot.drivers.links.device_files import open_serial
from robot.drivers.links.gpio import LinePlace
from robot.drivers.links.i2c import I2CBus as I2CHandle
from robot.drivers.sensors.ads1115 import INPUTS_PER_CHIP, ADS1115Settings
from robot.drivers.sensors.analogue import AnalogueAxes, StrainGauge, SwitchSettings
from robot.drivers.sensors.contracts import BoardSettings, SensorSettings
from robot.drivers.sensors.dmm32 import DMM32Settings
from robot.drivers.sensors.gpio import GPIOSwitchSettings
from robot.drivers.sensors.mpu6050 import MPU6050Settings
from robot.drivers.sensors.vl6180x import VL6180XSettings
from robot.drivers.servos.dynamixel import DynamixelSettings
from robot.drivers.servos.feetech import FeetechSettings
from robot.drivers.servos.pca9685 import PCA9685Settings
from robot.drivers.servos.pca9685_board import TICKS
from robot.drivers.servos.servo_bus import ServoBus, ServoSettings
from robot.drivers.servos.sv203 import SV203Settings
from robot.host.clock import Clock
from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.bus_servos import BusServos
from sim_robot.electronics.clock import TICK
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.dynamixel import DynamixelEmulator
from sim_robot.electronics.fault_switch import FaultSwitch
from sim_robot.electronics.feetech import FeetechEmulator
from sim_robot.electronics.gpio import LINES, Chip, GPIOEmulator
from sim_robot.electronics.i2c_bus import I2CBus, I2CDevice
from sim_robot.electronics.mpu6050 import MPU6050Emulator
from sim_robot.electronics.pca9685 import PCA9685Emulator
from sim_robot.electronics.serial_device import Follower
from sim_robot.electronics.servos import Felt
from sim_robot.electronics.sv203 import SV203Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from sim_robot.simulator.electronics_sets import REACH_MM
from sim_robot.simulator.stand_ins import StandInBoard, StandInSensor, StandInServos
from sim_robot.simulator.wiring import Wiring

_LAG_OF_BUS_SERVOS: Final = 0.05  # s; they have a top speed of their own


class EmulatedElectronics:
    """What a robot's drivers find, connected to the world of its body.

    Args:
        config: The configuration, for a body whose joints and feet are in its order.

    Attributes:
        config: The configuration, with stand-ins.
        lag: Time until a servo drives to where it was last sent, in small steps, s.
        notes: What is not rehearsed, and why, a sentence each.
    """

    def __init__(self, config: RobotConfig) -> None:
        self._stand_in_notes: list[str] = []
        self.config = self._with_stand_ins(config)
        self.notes = tuple(self._stand_in_notes)
        self.lag = TICK
        self._switches: dict[str, FaultSwitch] = {}
        self._pwm: list[PCA9685Emulator] = []
        self._serial: SV203Emulator | BusServos[Any] | None = None
        self._bus_servos: BusServos[Any] | None = None
        servos = self.config.servos
        outputs = [joint.output for joint in self.config.joints]
        self._places = [servos.outputs.index(output) for output in outputs]  # used at each step
        if isinstance(servos, SV203Settings):
            self._serial = self._switches["servo_board"] = SV203Emulator(boards=servos.boards)
        elif isinstance(servos, FeetechSettings | DynamixelSettings):
            feetech = isinstance(servos, FeetechSettings)
            emulator = FeetechEmulator if feetech else DynamixelEmulator
            self._serial = self._bus_servos = emulator(outputs, baud=servos.baud)
            self._switches["feetech" if feetech else "dynamixel"] = self._serial
            self.lag = _LAG_OF_BUS_SERVOS

    @property
    def switches(self) -> Mapping[str, FaultSwitch]:
        """What can fail, by its name at the fault panel; of several chips of a kind the first.

        Complete after ``connect``.
        """
        return self._switches

    def connect(self, wiring: Wiring, clock: Clock) -> None:
        """Makes the emulators of all but servos on a serial line; ``clock`` is the world's."""
        self._wiring = wiring
        config = self.config
        if self._bus_servos is not None:
            self._bus_servos.connect(clock)
        devices: defaultdict[int, list[I2CDevice]] = defaultdict(list)
        if isinstance(config.servos, PCA9685Settings):
            self._pwm = [PCA9685Emulator(clock, address=one) for one in config.servos.boards]
            devices[config.servos.bus] += self._pwm
            self._switches["pwm"] = self._pwm[0]
        if isinstance(config.daq, ADS1115Settings):
            chips = [
                ADS1115Emulator(_from(wiring.volts, INPUTS_PER_CHIP * index), clock, address=one)
                for index, one in enumerate(config.daq.addresses)
            ]
            devices[config.daq.bus] += chips
            self._switches["adc"] = chips[0]
        if isinstance(config.daq, DMM32Settings):
            self._daq = DMM32Emulator(wiring.volts, clock, base=config.daq.base)
            self._switches["daq"] = self._daq
        if isinstance(tilt := config.accelerometer, MPU6050Settings):
            self._imu = MPU6050Emulator(
                lambda: _in_chip_axes(tilt.mounting, wiring.acceleration()),
                clock,
                address=tilt.address,
            )
            devices[tilt.bus].append(self._imu)
            self._switches["accelerometer"] = self._imu
        if config.distance is not None and isinstance(
            finder := config.distance.driver, VL6180XSettings
        ):
            sensor = VL6180XEmulator(wiring.distance_mm, clock, reach_mm=REACH_MM)
            devices[finder.bus].append(sensor)
            self._switches["distance"] = sensor
        self._i2c = {number: I2CBus(bus_devices, clock) for number, bus_devices in devices.items()}
        for bus in list(self._i2c.values())[:1]:
            self._switches["i2c"] = bus
        self._connect_lines(clock)

    def buses(self, clock: Clock) -> Buses:
        """Buses that lead drivers to the emulators; ``clock`` is the robot's."""

        def port(path: str, baud: int) -> Any:
            servos = self.config.servos
            emulator = self._serial if path == getattr(servos, "port", None) else None
            return open_serial(emulator.port if emulator is not None else path, baud)

        return Buses(
            clock=clock,
            open_serial=port,
            open_ports=lambda base: self._daq,
            open_i2c=self._open_i2c,
            gpio=self._gpio,
        )

    def pulses(self) -> Sequence[int]:
        """The count of each joint, 0 where there are no pulses."""
        if self._bus_servos is not None:
            return self._bus_servos.pulses()
        servos = self.config.servos
        counts: Sequence[int]  # at all outputs
        if self._serial is not None:
            counts = self._serial.pulses()
        elif isinstance(servos, PCA9685Settings):
            counts = commanded(servos, self._pwm)
        else:
            assert isinstance(servos, StandInServos)
            counts = list(servos.driver.read_counts(servos.outputs).values())
        return [counts[place] for place in self._places]

    def feel(self, find: Callable[[], Sequence[Felt]]) -> None:
        """Has servos that measure find what the world has, in the order of ``pulses``."""
        if self._bus_servos is not None:
            self._bus_servos.feel(find)

    def follow(self, servos: ServoBus) -> Callable[[], None]:
        """Returns what waits, when called, until a serial line has had all that the driver sent."""
        if self._serial is None:
            return lambda: None
        return Follower(self._serial, cast(Any, servos))

    def begin_interaction(self) -> None:
        """Restarts the dither of an MPU-6050, so that a repeated observation reads the same."""
        if isinstance(self.config.accelerometer, MPU6050Settings):
            self._imu.restart_dither()

    def close(self) -> None:
        """Removes the serial port."""
        if self._serial is not None:
            self._serial.close()

    def _open_i2c(self, path: str) -> I2CHandle:
        return self._i2c[int(re.findall(r"\d+$", path)[0])].open(path)

    def _connect_lines(self, clock: Clock) -> None:
        """Makes GPIO chips with the lines of feet, and of a servo board's pin OE."""
        servos = self.config.servos
        enable = servos.enable if isinstance(servos, PCA9685Settings) else None
        feet = {
            number: point.driver
            for number, point in enumerate(self.config.touch)
            if isinstance(point.driver, GPIOSwitchSettings)
        }
        places = [foot.place for foot in feet.values()] + [enable] * (enable is not None)
        chips = list(_chips([place for place in places if place is not None]))
        by_line = {_line_of(chips, foot.place): (number, foot) for number, foot in feet.items()}

        def level(chip: str, line: int) -> bool | None:
            number, foot = by_line.get((chip, line), (0, None))
            if foot is None or not self._wiring.pressed(number):
                return None
            return not foot.active_low

        def driven(chip: str, line: int, high: bool) -> None:
            if enable is not None and _line_of(chips, enable) == (chip, line):
                for board in self._pwm:  # all pins OE are on it
                    board.drive_enable(high)

        self._gpio = GPIOEmulator(chips, level, clock, driven=driven)
        if chips:
            self._switches["gpio"] = self._gpio

    # --- stand-ins ------------------------------------------------------------------------------

    def _with_stand_ins(self, config: RobotConfig) -> RobotConfig:
        """The configuration with stand-ins for the drivers that there is no emulator of."""
        servos, daq, distance = config.servos, config.daq, config.distance
        tilt = config.accelerometer
        emulated = SV203Settings | PCA9685Settings | FeetechSettings | DynamixelSettings
        if not isinstance(servos, emulated):
            self._note_stand_in("servos", servos.name)
            servos = cast(ServoSettings, StandInServos(servos))
        if daq is not None and not isinstance(daq, DMM32Settings | ADS1115Settings):
            self._note_stand_in("daq", daq.name)
            daq = cast(BoardSettings, StandInBoard(daq, self._volts))
        if tilt is not None and not isinstance(tilt, MPU6050Settings | AnalogueAxes):
            tilt = self._sensor("accelerometer", tilt, Wiring.gravity)
        if distance is not None and not isinstance(distance.driver, VL6180XSettings):
            finder = self._sensor("distance", distance.driver, Wiring.distance)
            distance = replace(distance, driver=cast(Any, finder))
        return replace(
            config,
            servos=servos,
            daq=daq,
            accelerometer=tilt,
            touch=tuple(
                point
                if isinstance(point.driver, StrainGauge | SwitchSettings | GPIOSwitchSettings)
                else replace(point, driver=self._foot(number, point.name, point.driver))
                for number, point in enumerate(config.touch)
            ),
            distance=distance,
        )

    def _volts(self, channel: int) -> float:
        return self._wiring.volts(channel)

    def _foot(self, number: int, name: str, driver: SensorSettings) -> SensorSettings:
        return self._sensor(f"touch {name}", driver, lambda wiring: wiring.pressed(number))

    def _sensor(
        self, table: str, settings: SensorSettings, read: Callable[[Wiring], Any]
    ) -> SensorSettings:
        self._note_stand_in(table, settings.name)
        sensor = StandInSensor(f"stand-in for {settings.name}", lambda: read(self._wiring))
        return cast(SensorSettings, sensor)

    def _note_stand_in(self, table: str, name: str) -> None:
        self._stand_in_notes.append(
            f"[{table}]: there is no emulator of the {brief(name)}: a stand-in gives what the "
            "contract of its driver promises, and the driver itself is not rehearsed"
        )


# --- wires --------------------------------------------------------------------------------------


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


def _from(volts: Callable[[int], float], first: int) -> Callable[[int], float]:
    """Volts at the inputs of a chip, the first of which is the board's input ``first``."""
    return lambda channel: volts(first + channel)


def _in_chip_axes(mounting: Sequence[str], along: Sequence[float]) -> list[float]:
    """Acceleration along a chip's own x, y, z, mounted so that these point forward, left and up."""
    acceleration = [0.0] * 3
    for axis, value in zip(mounting, along, strict=True):
        acceleration["xyz".index(axis[-1])] = -value if axis.startswith("-") else value
    return acceleration


def _chips(places: Sequence[LinePlace]) -> Iterator[Chip]:
    """Chips that have the lines at some places, by device file, label, number and name."""
    numbers = count()
    taken_paths = {place.chip for place in places}
    for chip_name in dict.fromkeys(place.chip for place in places):
        path = chip_name
        if not chip_name.startswith("/"):
            path = next(one for n in numbers if (one := f"/dev/gpiochip{n}") not in taken_paths)
        lines = [place.line for place in places if place.chip == chip_name]
        free = (number for number in range(LINES) if number not in lines)
        names = dict(zip(free, (line for line in lines if isinstance(line, str)), strict=False))
        yield Chip(path=path, label=chip_name if path != chip_name else "emulated", names=names)


def _line_of(chips: Sequence[Chip], place: LinePlace) -> tuple[str, int]:
    """The path of the chip, and the number of the line, that a place means."""
    (chip,) = (chip for chip in chips if place.chip in (chip.path, chip.label))
    if isinstance(place.line, int):
        return chip.path, place.line
    return chip.path, next(n for n, name in chip.names.items() if name == place.line)
