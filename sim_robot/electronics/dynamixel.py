"""Emulated DYNAMIXEL X servos (XL430-W250) on a half-duplex serial line, at the level of bytes.

Source: ROBOTIS e-Manual, XL430-W250 and DYNAMIXEL Protocol 2.0. Where these are silent the emulator
assumes, and drivers should not rely on it: a write that touches anything it must not changes
nothing; after a reset a servo is deaf for 0.3 s, and its goal is where it stands; one that switched
its torque off answers *result fail* when it is told to switch it on. Not modelled:
acceleration, gains, homing offset, modes without a goal position, whose motor stands still,
registered and bulk instructions, and the load at which a servo calls itself overloaded: that is
injected.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from types import MappingProxyType
from typing import ClassVar, Final

from robot.drivers.servos.dynamixel_packets import (
    ALERT,
    BROADCAST,
    Decoder,
    Instruction,
    Packet,
    PacketError,
    encode,
)
from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import EVERY_NTH
from sim_robot.electronics.serial_device import SerialDevice

TICKS: Final = 4096
"""Positions of a turn."""
MODEL: Final = 1060
FIRMWARE: Final = 47
BAUDS: Final = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)
"""What register 8 says, by its value."""
LIMP: Final = 0
BOOT: Final = 0.3
"""Seconds after a reset in which a servo answers nothing."""
POSITION_MODE: Final = 3
OVERLOAD, SHOCK, OVERHEATED, VOLTAGE = 0x20, 0x10, 0x04, 0x01
"""Bits of the hardware error status, and of what switches the torque off."""

_TICKS_PER_UNIT_SECOND: Final = 0.229 / 60 * TICKS  # of a velocity register, 0.229 rev/min a unit
_WATCHDOG_UNIT: Final = 0.02  # s
_TRIPPED: Final = 0xFF
_PWM_FULL: Final = 885
_WARM, _HOT = 38, 85  # °C
_VOLTS, _DIPPED = 120, 55  # 0.1 V
_OTHERS_GOAL: Final = 3000  # where the event "moved" sends a servo


@dataclass(frozen=True)
class Register:
    """An item of the control table.

    Attributes:
        address: Its first byte.
        size: Bytes, low first.
        initial: What it holds after power-up, in the EEPROM area when it leaves the factory.
        span: The numbers that may be written; ``None``: it can only be read.
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
        "baud": Register(8, 1, 1, (0, 7)),
        "return_delay": Register(9, 1, 250, (0, 254)),
        "drive_mode": Register(10, 1, 0, (0, 13)),
        "mode": Register(11, 1, POSITION_MODE, (0, 16)),
        "shadow_id": Register(12, 1, 255, (0, 255)),
        "protocol": Register(13, 1, 2, (1, 2)),
        "homing": Register(20, 4, 0, (-1_044_479, 1_044_479)),
        "moving_threshold": Register(24, 4, 10, (0, 1023)),
        "temperature_limit": Register(31, 1, 72, (0, 100)),
        "voltage_max": Register(32, 2, 140, (60, 140)),
        "voltage_min": Register(34, 2, 60, (60, 140)),
        "pwm_limit": Register(36, 2, _PWM_FULL, (0, _PWM_FULL)),
        "velocity_limit": Register(44, 4, 265, (0, 1023)),
        "position_max": Register(48, 4, TICKS - 1, (0, TICKS - 1)),
        "position_min": Register(52, 4, 0, (0, TICKS - 1)),
        "startup": Register(60, 1, 0, (0, 3)),
        "shutdown": Register(63, 1, OVERLOAD | SHOCK | OVERHEATED, (0, 63)),
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
        "load": Register(126, 2),
        "velocity": Register(128, 4),
        "position": Register(132, 4),
        "velocity_trajectory": Register(136, 4),
        "trajectory": Register(140, 4),
        "voltage": Register(144, 2),
        "temperature": Register(146, 1),
    }
)
"""The control table, as far as it is emulated."""

_BYTES: Final = MappingProxyType(
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


class Servo:
    """One servo: packets in, packets out, and where it drives its horn; no I/O, no threads.

    Without a world around it, its horn is wherever the motor drives it.

    Args:
        number: Its id.
        now: Its own clock, s.

    Attributes:
        now: As given; may be replaced.
        position: Where its horn stands, in ticks.
        heat: Its temperature, °C.
        volts: Its supply, 0.1 V.
        switched_on: When its supply came, or it was rebooted, on its clock, s.
    """

    def __init__(self, number: int, now: Callable[[], float] = lambda: 0.0):
        self.now = now
        self.position = TICKS / 2
        self._load = 0.0
        self._felt = False
        self._held = {name: register.initial for name, register in REGISTERS.items()}
        self._held["id"] = number
        self.heat, self.volts = _WARM, _VOLTS
        self.power_up()
        self.switched_on -= BOOT

    def power_up(self) -> None:
        """What the supply's coming (back) and a reboot do: RAM begins anew, torque is off."""
        for name, register in REGISTERS.items():
            if register.address not in EEPROM:
                self._held[name] = register.initial
        self.switched_on = self._heard = self._looked = self.now()
        self._trajectory = self.position
        self._held["goal"] = round(self.position)
        self._held["torque"] = self["startup"] & 1
        self._check_itself()

    @property
    def baud(self) -> int:
        """At which it listens."""
        return BAUDS[self["baud"]]

    def __getitem__(self, name: str) -> int:
        """What a register holds."""
        return self._held[name]

    def __setitem__(self, name: str, value: int) -> None:
        """Sets a register, as its maker's program could."""
        self._held[name] = value

    def feel(self, position: float, load: float) -> None:
        """What the world does to it: where its horn is, in ticks, and the share of its torque."""
        self.position, self._load, self._felt = position, load, True

    def fail(self, bit: int) -> None:
        """A hardware error: it is remembered, and switches the torque off where it shall."""
        self._held["hardware_error"] |= bit
        if bit & self["shutdown"]:
            self._held["torque"] = 0

    def driven_to(self) -> float:
        """The position that the motor holds, in ticks; ``LIMP`` where it has no torque."""
        now = self.now()
        self._check_itself()
        if self["torque"] and self["mode"] == POSITION_MODE:
            way = self["goal"] - self._trajectory
            reach = self["profile_velocity"] * _TICKS_PER_UNIT_SECOND * (now - self._looked)
            if self["profile_velocity"] and abs(way) > reach:
                way = reach if way > 0 else -reach
            self._trajectory += way
        self._looked = now
        if self["torque"] and not self._felt:
            self.position = self._trajectory
        return max(self._trajectory, 1.0) if self["torque"] else LIMP

    def answer(self, packet: Packet) -> Packet | None:
        """Acts on a packet for this servo alone, and answers if it shall."""
        if self.now() - self.switched_on < BOOT:
            return None
        self._heard_something()
        self._check_itself()
        error, data = 0, b""
        try:
            data = self._do(packet)
        except Refused as refusal:
            error = refusal.error
        level = {int(Instruction.PING): 0, int(Instruction.READ): 1}.get(packet.instruction, 2)
        if level > (0 if packet.id == BROADCAST else self["return_level"]):
            return None
        error |= ALERT if self["hardware_error"] else 0
        return Packet(self["id"], Instruction.STATUS, bytes((error,)) + data)

    def _do(self, packet: Packet) -> bytes:
        parameters = packet.parameters
        match packet.instruction:
            case Instruction.PING:
                return self._bytes(0, 2) + self._bytes(6, 1)
            case Instruction.READ if len(parameters) >= 4:
                return self._bytes(_word(parameters), _word(parameters[2:]))
            case Instruction.WRITE if len(parameters) > 2:
                self._write(_word(parameters), parameters[2:])
            case Instruction.REBOOT:
                self.power_up()
            case Instruction.READ | Instruction.WRITE:
                raise Refused(PacketError.DATA_LENGTH)
            case _:
                raise Refused(PacketError.INSTRUCTION)
        return b""

    def _bytes(self, first: int, size: int) -> bytes:
        """What stands in the table from an address on, measured now."""
        if first + size > _FIRST_MEASURED:
            self._measure()
        found = bytearray()
        for address in range(first, first + size):
            if address not in _BYTES:
                raise Refused(PacketError.ACCESS)
            name, shift = _BYTES[address]
            found.append(self._held[name] >> shift & 0xFF)
        return bytes(found)

    def _write(self, first: int, data: bytes) -> None:
        changes = dict(self._changes(first, data))
        if self["hardware_error"] & self["shutdown"] and changes.get("torque"):
            raise Refused(PacketError.RESULT_FAIL)  # only a reboot helps
        self.driven_to()
        if changes.get("torque") and not self["torque"]:
            self._trajectory = self.position
        self._held |= changes

    def _changes(self, first: int, data: bytes) -> Iterator[tuple[str, int]]:
        at = first
        while at < first + len(data):
            name, shift = _BYTES.get(at, ("model", 0))
            register = REGISTERS[name]
            if register.span is None or (at in EEPROM and self["torque"]):
                raise Refused(PacketError.ACCESS)
            if shift:
                raise Refused(PacketError.DATA_LENGTH)
            part = data[at - first : at - first + register.size]
            if len(part) < register.size:
                raise Refused(PacketError.DATA_LENGTH)
            value = int.from_bytes(part, "little", signed=register.span[0] < 0)
            if not register.span[0] <= value <= register.span[1]:
                raise Refused(PacketError.DATA_RANGE)
            if name == "goal":
                if self["watchdog"] == _TRIPPED:
                    raise Refused(PacketError.DATA_RANGE)
                limits = self["position_min"], self["position_max"]
                if self["mode"] == POSITION_MODE and not limits[0] <= value <= limits[1]:
                    raise Refused(PacketError.DATA_LIMIT)
            yield name, value
            at += register.size

    def _heard_something(self) -> None:
        now = self.now()
        limit = self["watchdog"] * _WATCHDOG_UNIT
        if self["torque"] and 0 < self["watchdog"] < _TRIPPED and now - self._heard > limit:
            self._held["watchdog"] = _TRIPPED
        self._heard = now

    def _check_itself(self) -> None:
        if self.heat > self["temperature_limit"]:
            self.fail(OVERHEATED)
        if not self["voltage_min"] <= self.volts <= self["voltage_max"]:
            self.fail(VOLTAGE)

    def _measure(self) -> None:
        """Brings the registers that only tell up to date."""
        self.driven_to()
        on_its_way = bool(self["torque"]) and round(self._trajectory) != self["goal"]
        self._held |= {
            "tick": int((self.now() - self.switched_on) * 1000) % 32768,
            "moving": int(on_its_way),
            "moving_status": 2 * on_its_way,
            "present_pwm": round(self._load * _PWM_FULL),
            "load": round(self._load * 1000),
            "position": round(self.position),
            "trajectory": round(self._trajectory if self["torque"] else self.position),
            "voltage": self.volts,
            "temperature": self.heat,
        }


class DynamixelEmulator(SerialDevice):
    """Servos on a serial line.

    Args:
        ids: Theirs, in the order of the robot's joints.
        baud: At which they listen, one of ``BAUDS``.
    """

    FAULTS: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            **SerialDevice.FAULTS,
            "silent": "servo n answers nothing and has no torque, as without its cable",
            "garbage": "every n-th answer arrives with a bit flipped",
            "lost": "every n-th answer is lost",
            "twin": "another servo on the line has the id n, too",
            "hot": f"servo n is at {_HOT} °C: it switches its torque off",
            "dip": f"the supply gives {_DIPPED / 10:g} V",
        }
    )
    EVENTS: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "reboot": "the supply of servo n dips, of all without a number: it comes back limp",
            "overload": "servo n is overloaded, and switches its torque off",
            "moved": f"another program on the line sends servo n to {_OTHERS_GOAL}",
            "velocity_mode": "another program sets servo n to velocity mode, its torque off",
        }
    )
    NUMBERS: ClassVar[Mapping[str, range]] = MappingProxyType(
        {**SerialDevice.NUMBERS, "garbage": EVERY_NTH, "lost": EVERY_NTH}
    )

    def __init__(self, ids: Iterable[int] = (1,), *, baud: int = 1_000_000):
        self.servos = [Servo(number) for number in ids]
        for servo in self.servos:
            servo["baud"] = BAUDS.index(baud)
            servo.power_up()
        self._decoder = Decoder()
        self._answers = 0
        self._twin: list[Servo] = []
        self._find: Callable[[], Iterable[tuple[float, float]]] = tuple
        super().__init__()

    def connect(self, clock: Clock) -> None:
        """Gives the servos the time of their world, in which they have been on for a while."""
        for servo in self.servos:
            servo.now = clock.now
            servo.power_up()
            servo.switched_on -= BOOT

    def feel(self, find: Callable[[], Iterable[tuple[float, float]]]) -> None:
        """Puts the servos into a world.

        Args:
            find: Where the horn of each stands, in ticks, and the share of its torque that it
                gives; asked when a packet comes.
        """
        self._find = find

    def pulses(self) -> tuple[int, ...]:
        """The position that each servo drives to, in ticks, or ``LIMP``."""
        with self._changed:
            silent = self._faults.get("silent")
            return tuple(
                LIMP if number == silent else round(servo.driven_to())
                for number, servo in enumerate(self.servos, 1)
            )

    def numbers(self, fault: str) -> Sequence[int]:
        """Of what befalls a servo, those of all of them from 1; of a reboot also 0, for all."""
        match fault:
            case "silent" | "twin" | "hot" | "overload" | "moved" | "velocity_mode":
                return range(1, len(self.servos) + 1)
            case "reboot":
                return range(len(self.servos) + 1)
        return super().numbers(fault)

    def inject(self, fault: str, value: int = 0) -> None:
        """Switches a fault on, or makes an event happen."""
        super().inject(fault, value)
        self._feel()

    def mend(self, fault: str | None = None) -> None:
        """Switches a fault off, or all of them."""
        super().mend(fault)
        self._feel()

    def receive(self, data: bytes) -> bytes:
        """Gives bytes to every servo that listens at this baud rate; returns what they answer."""
        if self.host_baud not in {servo.baud for servo in self.servos}:
            return b""  # noise, to all of them
        packets = self._decoder.feed(data)
        for servo, (position, load) in zip(
            self.servos, self._find() if packets else (), strict=False
        ):
            servo.feel(position, load)
        return b"".join(line for packet in packets for line in self._collided(packet))

    def _collided(self, packet: Packet) -> Iterator[bytes]:
        """The answers to a packet, one after another; of servos that share an id at once."""
        if packet.instruction == Instruction.SYNC_WRITE:
            self._sync_write(packet.parameters)
            return
        ids: Iterable[int] = (packet.id,)
        if packet.instruction == Instruction.SYNC_READ:
            ids = packet.parameters[4:]
            packet = Packet(0, Instruction.READ, packet.parameters[:4])
        elif packet.id == BROADCAST:
            ids = sorted({servo["id"] for servo in self.servos})
        for number in ids:
            answers = [servo.answer(packet) for servo in self._called(number)]
            lines = [encode(answer) for answer in answers if answer is not None]
            if lines:
                # A low level wins on the line.
                line = bytes(map(_and, zip_longest(*lines, fillvalue=0xFF)))
                yield self._spoilt(line) if self._faults else line

    def _sync_write(self, parameters: bytes) -> None:
        size = _word(parameters[2:]) if len(parameters) >= 4 else 0
        for at in range(4, len(parameters), size + 1):
            number, data = parameters[at], parameters[at + 1 : at + 1 + size]
            for servo in self._called(number):
                servo.answer(Packet(BROADCAST, Instruction.WRITE, parameters[:2] + data))

    def _called(self, number: int) -> list[Servo]:
        """The servos with an id that listen."""
        silent = self._faults.get("silent")
        return [
            servo
            for index, servo in enumerate((*self.servos, *self._twin), 1)
            if servo["id"] == number and servo.baud == self.host_baud and index != silent
        ]

    def _spoilt(self, line: bytes) -> bytes:
        self._answers += 1
        garbage, lost = self._faults.get("garbage"), self._faults.get("lost")
        if lost is not None and self._answers % max(lost, 1) == 0:
            return b""
        if garbage is not None and self._answers % max(garbage, 1) == 0:
            return line[:-3] + bytes((line[-3] ^ 1,)) + line[-2:]
        return line

    def _happen(self, event: str, value: int) -> None:
        with self._changed:
            for servo in [self.servos[value - 1]] if value else self.servos:
                match event:
                    case "reboot":
                        servo.power_up()
                    case "overload":
                        servo.fail(OVERLOAD)
                    case "moved":
                        servo["goal"] = _OTHERS_GOAL
                    case "velocity_mode":
                        servo["torque"], servo["mode"] = 0, 1

    def _feel(self) -> None:
        """Brings the servos into the state that the faults make."""
        with self._changed:
            hot, twin = self._faults.get("hot"), self._faults.get("twin")
            for number, servo in enumerate(self.servos, 1):
                servo.heat = _HOT if number == hot else _WARM
                servo.volts = _DIPPED if "dip" in self._faults else _VOLTS
            self._twin.clear()
            if twin is not None:
                model = self.servos[twin - 1]
                other = Servo(model["id"], model.now)
                other["baud"] = model["baud"]
                other.position = model.position
                other.switched_on -= 0.137
                self._twin.append(other)


def _word(data: bytes) -> int:
    return int.from_bytes(data[:2], "little")


def _and(column: Sequence[int]) -> int:
    value = 0xFF
    for byte in column:
        value &= byte
    return value
