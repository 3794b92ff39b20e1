"""The electronics that somebody's own ``robot.toml`` names, emulated: a rehearsal of that file.

Wiring, limits and calibration are the file's. A device that has an emulator is emulated, at the
address, port or line that the file says. A driver without an emulator is not rehearsed: a stand-in
gives what its contract promises, straight from the simulated body, and a note says so.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from typing import Any, ClassVar, Final, cast

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
from robot.drivers.servos.servo_bus import ServoBus, ServoSettings
from robot.drivers.servos.sv203 import SV203Settings
from robot.host.clock import Clock
from robot.service.dry_run import NullServos
from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.bus_servos import BusServos
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
from sim_robot.errors import BodyError
from sim_robot.simulator.bus_servo_sets import BusServoSet
from sim_robot.simulator.electronics_set import REACH_MM, ElectronicsSet
from sim_robot.simulator.pi_set import commanded
from sim_robot.simulator.stand_ins import StandInBoard, StandInSensor, StandInServos
from sim_robot.simulator.wiring import Wiring
from sim_robot.world.body import Body, load_body, shipped_bodies
from sim_robot.world.sensor_noise import NoiseLevels

_SIZE_TOLERANCE: Final = 2e-3  # m by which a main body may differ from the file without a word
_MASS_TOLERANCE: Final = 0.05  # kg by which its mass may differ without a word, or
_MASS_SHARE: Final = 0.05  # this share of its mass


class OwnSet(ElectronicsSet):
    """Electronics that a configuration names.

    Args:
        body: Body from ``fitted``.
        config: The configuration.

    Attributes:
        notes: What is not rehearsed, and why, a sentence each.
    """

    summary: ClassVar[str] = "those of your robot.toml"

    def __init__(self, body: Body, config: RobotConfig) -> None:
        super().__init__(body)
        self._stand_in_notes: list[str] = []
        self._config = self._with_stand_ins(config)
        self.notes = tuple(self._stand_in_notes)
        self._switches: dict[str, FaultSwitch] = {}
        self._pwm: list[PCA9685Emulator] = []
        self._serial: SV203Emulator | BusServos[Any] | None = None
        self._stand_in: NullServos | None = None
        servos = self._config.servos
        if isinstance(servos, SV203Settings):
            self._serial = self._switches["servo_board"] = SV203Emulator(boards=servos.boards)
        elif isinstance(servos, FeetechSettings | DynamixelSettings):
            feetech = isinstance(servos, FeetechSettings)
            emulator = FeetechEmulator if feetech else DynamixelEmulator
            ids = [joint.output for joint in self._config.joints]
            self._serial = emulator(ids, baud=servos.baud)
            self._switches["feetech" if feetech else "dynamixel"] = self._serial
            self.lag = BusServoSet.lag
        elif isinstance(servos, StandInServos):
            self._stand_in = servos.driver

    @property
    def switches(self) -> Mapping[str, FaultSwitch]:
        """Emulators by name, of several of a kind the first."""
        return self._switches

    def configure(self, levels: NoiseLevels) -> RobotConfig:
        """The file's configuration, with stand-ins; it announces the file's noise."""
        del levels
        return self._config

    def connect(self, wiring: Wiring, clock: Clock) -> None:
        """Makes the emulators of all but a serial servo board."""
        self._wiring = wiring
        config = self._config
        if isinstance(self._serial, BusServos):
            self._serial.connect(clock)
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
        """Emulated I/O ports, I²C buses and GPIO chips; the serial line is a real one."""

        def port(path: str, baud: int) -> Any:
            servos = self._config.servos
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
        """The count of each joint, in the file's order."""
        counts = self._counts_by_output()
        return [counts[joint.output] for joint in self._config.joints]

    def feel(self, find: Callable[[], Sequence[Felt]]) -> None:
        """Tells servos that answer where the world has their joints."""
        if isinstance(self._serial, BusServos):
            self._serial.feel(find)

    def follow(self, servos: ServoBus) -> Callable[[], None]:
        """Returns what waits for the thread that reads a serial line."""
        if self._serial is None:
            return lambda: None
        return Follower(self._serial, cast(Any, servos))

    def begin_interaction(self) -> None:
        """Restarts the dither of an MPU-6050, which alone counts its samples."""
        if isinstance(self._config.accelerometer, MPU6050Settings):
            self._imu.restart_dither()

    def close(self) -> None:
        """Removes the serial port."""
        if self._serial is not None:
            self._serial.close()

    def _counts_by_output(self) -> Mapping[int, int]:
        """The count at each output."""
        servos = self._config.servos
        if self._stand_in is not None:
            return self._stand_in.read_counts(servos.outputs)
        if isinstance(self._serial, BusServos):
            ids = (joint.output for joint in self._config.joints)
            return dict(zip(ids, self._serial.pulses(), strict=True))
        if self._serial is not None:
            return dict(zip(servos.outputs, self._serial.pulses(), strict=True))
        assert isinstance(servos, PCA9685Settings)
        return dict(zip(servos.outputs, commanded(servos, self._pwm), strict=True))

    def _open_i2c(self, path: str) -> I2CHandle:
        return self._i2c[int(re.findall(r"\d+$", path)[0])].open(path)

    def _connect_lines(self, clock: Clock) -> None:
        """Makes GPIO chips with the lines of feet, and of a servo board's pin OE."""
        servos = self._config.servos
        enable = servos.enable if isinstance(servos, PCA9685Settings) else None
        feet = {
            number: point.driver
            for number, point in enumerate(self._config.touch)
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


# --- a body that fits ---------------------------------------------------------------------------


def fitted(body: Body, config: RobotConfig) -> tuple[Body, list[str]]:
    """A body in the order of a configuration, so that joint and foot k are those of the file.

    Where the body has the file's names, joints and feet are matched by name; otherwise in order,
    which a note says. Feet that the file does not name have no sensor.

    Returns:
        The body, and notes on where it differs from the file, a sentence each.

    Raises:
        BodyError: The body has another number of joints, or not the feet that the file names.
    """
    joints = [joint.name for joint in config.joints]
    if len(joints) != len(body.motors):
        raise BodyError(
            body.name,
            "",
            f"has {len(body.motors)} joints, and {config.name} in robot.toml {len(joints)}: give "
            f"--body a body with {len(joints)}{_with_joints(len(joints))}.",
        )
    notes: list[str] = []
    motors = {motor.name: motor for motor in body.motors}
    if set(joints) == motors.keys():
        body = replace(body, motors=tuple(motors[name] for name in joints))
    else:
        pairs = ", ".join(f"{a} = {b}" for a, b in zip(joints, motors, strict=True))
        notes.append(f"the body's joints have other names, and are taken in order: {pairs}")
    feet = [point.name for point in config.touch]
    if set(feet) <= body.touch.keys():
        body = replace(body, touch={name: body.touch[name] for name in feet})
    elif len(feet) == len(body.touch):
        pairs = ", ".join(f"{a} = {b}" for a, b in zip(feet, body.touch, strict=True))
        notes.append(f"the body's feet have other names, and are taken in order: {pairs}")
        body = replace(body, touch=dict(zip(feet, body.touch.values(), strict=True)))
    else:
        raise BodyError(
            body.name,
            "",
            f"has the feet {', '.join(body.touch) or '(none)'}, and robot.toml names "
            f"{', '.join(feet)}: call them as they are called there, or give --body another body.",
        )
    return body, [*notes, *_differences(body, config)]


def _with_joints(number: int) -> str:
    names = [
        name for name, path in shipped_bodies().items() if len(load_body(path).motors) == number
    ]
    return f" (with as many comes {', '.join(names)})" if names else ""


def _differences(body: Body, config: RobotConfig) -> Iterator[str]:
    """Sentences on what the file, and so the robot, says otherwise than the body."""
    extents = zip(body.base_size, config.body.size, strict=True)
    if any(abs(one - other) > _SIZE_TOLERANCE for one, other in extents):
        sizes = body.base_size, config.body.size
        true, said = (" x ".join(f"{1000 * metres:.0f}" for metres in size) for size in sizes)
        yield f"the main body is {true} mm in the URDF and {said} mm in robot.toml"
    mass, said_mass = body.base_mass, config.body.mass
    if abs(mass - said_mass) > max(_MASS_TOLERANCE, _MASS_SHARE * mass):
        yield f"the main body has {mass:.3g} kg in the URDF and {said_mass:.3g} kg in robot.toml"
    if body.lies_flat != config.body.lies_flat:
        words = {True: "lies flat", False: "stands"}
        yield (
            f"with all joints at 0 the body {words[body.lies_flat]}, and robot.toml says that it "
            f"{words[config.body.lies_flat]} (body.zero_pose)"
        )


# --- wires ----------------------------------------------------------------------------------------


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
