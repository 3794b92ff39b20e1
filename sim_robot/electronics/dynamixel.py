"""Emulated DYNAMIXEL X servos (XL330-M288) on a half-duplex serial line, at the level of bytes.

Source: ROBOTIS e-Manual, XL330-M288 and DYNAMIXEL Protocol 2.0. Where these are silent the emulator
assumes, and drivers should not rely on it: a write that touches anything it must not changes
nothing; after a reset a servo is deaf for 0.3 s, and its goal is where it stands; one that switched
its torque off answers *result fail* when it is told to switch it on. Not modelled: acceleration,
gains but that of the position, homing offset, modes without a goal position, whose motor stands
still, registered and bulk instructions, and the load at which a servo calls itself overloaded: that
is injected.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from robot.drivers.servos.dynamixel_packets import ALERT, Decoder, PacketError, encode
from robot.drivers.servos.servo_packets import BROADCAST, Instruction, Packet
from sim_robot.electronics.bus_servos import LIMP, STEPS, BusServo, BusServos

MODEL: Final = 1200
FIRMWARE: Final = 52
BAUDS: Final = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)
"""Baud rates, by the value of register 8."""
POSITION_MODE: Final = 3
OVERLOAD, SHOCK, OVERHEATED, VOLTAGE = 0x20, 0x10, 0x04, 0x01
"""Bits of the hardware error status, and of ``shutdown``: which of them switch the torque off."""

_STEPS_PER_UNIT_SECOND: Final = 0.229 / 60 * STEPS  # of a velocity register, 0.229 rev/min a unit
_WATCHDOG_UNIT: Final = 0.02  # s
_TRIPPED: Final = 0xFF
_PWM_FULL: Final = 885
_P_GAIN: Final = 400 / 128  # PWM units a step
_STALL_CURRENT: Final = 1470  # mA at 5 V


@dataclass(frozen=True)
class Register:
    """An item of the control table.

    Attributes:
        address: Address of the first byte.
        size: Number of bytes, low first.
        initial: Value after power-up; in the EEPROM area, value when it leaves the factory.
        span: Lowest and highest number that may be written; ``None``: it can only be read.
    """

    address: int
    size: int
    initial: int = 0
    span: tuple[int, int] | None = None


REGISTERS: Final[Mapping[str, Register]] = MappingProxyType(
    {
        "model": Register(0, 2, MODEL),
        "information": Register(2, 4),
        "firmware": Register(6, 1, FIRMWARE),
        "id": Register(7, 1, 1, (0, 252)),
        "baud": Register(8, 1, 1, (0, 6)),
        "return_delay": Register(9, 1, 250, (0, 254)),
        "drive_mode": Register(10, 1, 0, (0, 13)),
        "mode": Register(11, 1, POSITION_MODE, (0, 16)),
        "shadow_id": Register(12, 1, 255, (0, 255)),
        "protocol": Register(13, 1, 2, (2, 22)),
        "homing": Register(20, 4, 0, (-1_044_479, 1_044_479)),
        "moving_threshold": Register(24, 4, 10, (0, 1023)),
        "temperature_limit": Register(31, 1, 70, (0, 100)),
        "voltage_max": Register(32, 2, 70, (31, 70)),
        "voltage_min": Register(34, 2, 35, (31, 70)),
        "pwm_limit": Register(36, 2, _PWM_FULL, (0, _PWM_FULL)),
        "current_limit": Register(38, 2, 1750, (0, 1750)),
        "velocity_limit": Register(44, 4, 445, (0, 2047)),
        "position_max": Register(48, 4, STEPS - 1, (0, STEPS - 1)),
        "position_min": Register(52, 4, 0, (0, STEPS - 1)),
        "startup": Register(60, 1, 0, (0, 3)),
        "pwm_slope": Register(62, 1, 140, (1, 255)),
        "shutdown": Register(63, 1, OVERLOAD | SHOCK | OVERHEATED | VOLTAGE, (0, 63)),
        "torque": Register(64, 1, 0, (0, 1)),
        "led": Register(65, 1, 0, (0, 1)),
        "return_level": Register(68, 1, 2, (0, 2)),
        "registered": Register(69, 1),
        "hardware_error": Register(70, 1),
        "watchdog": Register(98, 1, 0, (0, 127)),
        "goal_pwm": Register(100, 2, _PWM_FULL, (-_PWM_FULL, _PWM_FULL)),
        "profile_acceleration": Register(108, 4, 0, (0, 32767)),
        "profile_velocity": Register(112, 4, 0, (0, 32767)),
        "goal": Register(116, 4, 0, (-(2**31), 2**31 - 1)),
        "tick": Register(120, 2),
        "moving": Register(122, 1),
        "moving_status": Register(123, 1),
        "present_pwm": Register(124, 2),
        "current": Register(126, 2),
        "velocity": Register(128, 4),
        "position": Register(132, 4),
        "velocity_trajectory": Register(136, 4),
        "trajectory": Register(140, 4),
        "voltage": Register(144, 2),
        "temperature": Register(146, 1),
    }
)
"""The control table, as far as it is emulated."""

_REGISTER_AT: Final = MappingProxyType(
    {
        register.address + offset: (name, 8 * offset)
        for name, register in REGISTERS.items()
        for offset in range(register.size)
    }
)
_FIRST_MEASURED: Final = REGISTERS["tick"].address

EEPROM: Final = range(64)
"""Addresses that keep what they hold, and are locked while the torque is on."""


class Refused(Exception):  # noqa: N818 - an answer
    """A servo refuses what a packet asks for."""

    def __init__(self, error: PacketError):
        super().__init__(error)
        self.error = error


class Servo(BusServo):
    """One servo: packets in, packets out.

    Args:
        number: ID of the servo.
        now: Tells the time, s.
    """

    USUAL = 50
    DIPPED = 33

    def __init__(self, number: int, now: Callable[[], float] = lambda: 0.0):
        super().__init__()
        self.now = now
        self._values = {name: register.initial for name, register in REGISTERS.items()}
        self._values["id"] = number
        self.power_up()
        self.warm_up()

    def power_up(self) -> None:
        """Starts up, by supply or reboot: RAM begins anew, torque is as ``startup`` says."""
        for name, register in REGISTERS.items():
            if register.address not in EEPROM:
                self._values[name] = register.initial
        self.switched_on = self._heard_at = self._looked_at = self.now()
        self._trajectory = self.position
        self._values["goal"] = round(self.position)
        self._values["torque"] = self["startup"] & 1
        self.look()

    @property
    def number(self) -> int:
        """ID of the servo."""
        return self["id"]

    @property
    def baud(self) -> int:
        """Baud rate at which the servo listens."""
        return BAUDS[self["baud"]]

    def __getitem__(self, name: str) -> int:
        """Value of a register."""
        return self._values[name]

    def __setitem__(self, name: str, value: int) -> None:
        """Sets a register, as the maker's program could."""
        self._values[name] = value

    def fail(self, bit: int) -> None:
        """Remembers a hardware error, which switches the torque off if ``shutdown`` has its bit."""
        self._values["hardware_error"] |= bit
        if bit & self["shutdown"]:
            self._values["torque"] = 0

    def overload(self) -> None:
        """Makes the servo find itself overloaded."""
        self.fail(OVERLOAD)

    def send_to(self, position: int) -> None:
        """Moves the servo as another program would."""
        self._values["goal"] = position

    def set_wheel(self, on: bool) -> None:
        """Sets wheel mode, or position mode again, as another program would; torque goes off."""
        self._values |= {"torque": 0, "mode": 1 if on else POSITION_MODE}

    def twin(self) -> Servo:
        """Another servo with the same ID, switched on a moment before."""
        twin = Servo(self["id"], self.now)
        twin._values |= {"baud": self["baud"]}
        twin.position = self.position
        twin.switched_on = self.switched_on - 0.137
        return twin

    def driven_to(self) -> float:
        """The position that the motor drives to; ``LIMP`` where it has no torque."""
        now = self.now()
        self.look()
        if self["torque"] and self["mode"] == POSITION_MODE:
            goal, speed = self["goal"], self["profile_velocity"] * _STEPS_PER_UNIT_SECOND
            reach = speed * (now - self._looked_at) if speed else math.inf
            self._trajectory = min(max(goal, self._trajectory - reach), self._trajectory + reach)
        self._looked_at = now
        return self._drives(self._trajectory) if self["torque"] else LIMP

    def answer(self, packet: Packet) -> Packet | None:
        """Acts on a packet for this servo alone; returns its answer, or ``None``."""
        if self.deaf:
            return None
        self._feed_watchdog()
        self.look()
        error, data = 0, b""
        try:
            data = self._execute(packet)
        except Refused as refusal:
            error = refusal.error
        level = {int(Instruction.PING): 0, int(Instruction.READ): 1}.get(packet.instruction, 2)
        if level > (0 if packet.id == BROADCAST else self["return_level"]):
            return None
        error |= ALERT if self["hardware_error"] else 0
        return Packet(self["id"], Instruction.STATUS, bytes((error,)) + data)

    def _execute(self, packet: Packet) -> bytes:
        parameters = packet.parameters
        match packet.instruction:
            case Instruction.PING:
                return self._read(0, 2) + self._read(6, 1)
            case Instruction.READ if len(parameters) >= 4:
                return self._read(_word(parameters), _word(parameters[2:]))
            case Instruction.WRITE if len(parameters) > 2:
                self._write(_word(parameters), parameters[2:])
            case Instruction.REBOOT:
                self.power_up()
            case Instruction.READ | Instruction.WRITE:
                raise Refused(PacketError.DATA_LENGTH)
            case _:
                raise Refused(PacketError.INSTRUCTION)
        return b""

    def _read(self, first: int, size: int) -> bytes:
        """Bytes of the control table from an address on, measured now."""
        if first + size > _FIRST_MEASURED:
            self._measure()
        contents = bytearray()
        for address in range(first, first + size):
            if address not in _REGISTER_AT:
                raise Refused(PacketError.ACCESS)
            name, shift = _REGISTER_AT[address]
            contents.append(self._values[name] >> shift & 0xFF)
        return bytes(contents)

    def _write(self, first: int, data: bytes) -> None:
        changes = dict(self._changes(first, data))
        if self["hardware_error"] & self["shutdown"] and changes.get("torque"):
            raise Refused(PacketError.RESULT_FAIL)  # only a reboot helps
        self.driven_to()
        old_goal = self["goal"]
        if changes.get("torque") and not self["torque"]:
            old_goal = round(self.position)
            self._trajectory = self.position
        self._values |= changes
        if self["torque"] and self["goal"] != old_goal:
            self.on_move(old_goal, self["goal"])

    def _changes(self, first: int, data: bytes) -> Iterator[tuple[str, int]]:
        address = first
        while address < first + len(data):
            name, shift = _REGISTER_AT.get(address, ("model", 0))
            register = REGISTERS[name]
            if register.span is None or (address in EEPROM and self["torque"]):
                raise Refused(PacketError.ACCESS)
            if shift:
                raise Refused(PacketError.DATA_LENGTH)
            value_bytes = data[address - first : address - first + register.size]
            if len(value_bytes) < register.size:
                raise Refused(PacketError.DATA_LENGTH)
            value = int.from_bytes(value_bytes, "little", signed=register.span[0] < 0)
            if not register.span[0] <= value <= register.span[1]:
                raise Refused(PacketError.DATA_RANGE)
            if name == "goal":
                if self["watchdog"] == _TRIPPED:
                    raise Refused(PacketError.DATA_RANGE)
                limits = self["position_min"], self["position_max"]
                if self["mode"] == POSITION_MODE and not limits[0] <= value <= limits[1]:
                    raise Refused(PacketError.DATA_LIMIT)
            yield name, value
            address += register.size

    def _feed_watchdog(self) -> None:
        now = self.now()
        timeout = self["watchdog"] * _WATCHDOG_UNIT
        if self["torque"] and 0 < self["watchdog"] < _TRIPPED and now - self._heard_at > timeout:
            self._values["watchdog"] = _TRIPPED
        self._heard_at = now

    def look(self) -> None:
        """Compares temperature and supply with their limits, and fails beyond."""
        if self.heat > self["temperature_limit"]:
            self.fail(OVERHEATED)
        if not self["voltage_min"] <= self.volts <= self["voltage_max"]:
            self.fail(VOLTAGE)

    def _measure(self) -> None:
        """Brings the registers that can only be read up to date."""
        self.driven_to()
        miss = self._trajectory - self.position
        drive = max(-1.0, min(1.0, self.torque + _P_GAIN * miss / _PWM_FULL)) * self["torque"]
        on_its_way = bool(self["torque"]) and round(self._trajectory) != self["goal"]
        self._values |= {
            "tick": int((self.now() - self.switched_on) * 1000) % 32768,
            "moving": int(on_its_way),
            "moving_status": 2 * on_its_way,
            "present_pwm": round(drive * self["goal_pwm"]),
            "current": round(self.torque * _STALL_CURRENT) if self["torque"] else 0,
            "position": round(self.position),
            "trajectory": round(self._trajectory if self["torque"] else self.position),
            "voltage": self.volts,
            "temperature": self.heat,
        }


class DynamixelEmulator(BusServos[Servo]):
    """Servos on a serial line.

    Args:
        ids: IDs of the servos, in the order of the robot's joints.
        baud: Baud rate at which they listen, one of ``BAUDS``.
    """

    SYNC_HEAD = 4
    encode = staticmethod(encode)

    def __init__(self, ids: Iterable[int] = (1,), *, baud: int = 1_000_000):
        super().__init__(map(Servo, ids), Decoder())
        for servo in self.servos:
            servo["baud"] = BAUDS.index(baud)


def _word(data: bytes) -> int:
    return int.from_bytes(data[:2], "little")
