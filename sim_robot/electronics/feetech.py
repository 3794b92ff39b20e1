"""Emulated Feetech STS3215 servos on a half-duplex serial line, at the level of bytes.

Sources: Feetech, memory table of the STS and SMS series and its protocol manual; for what a written
goal does (torque goes on, a goal beyond the limits is driven to the limit, and the register keeps
what was written) those who measured it. Where these are silent the emulator assumes, and drivers
should not rely on it: after a reset a servo is deaf for 0.3 s, and its goal is where it stands, or
the end of the turn that is nearest; writing to the torque switch ends an overload; a locked
permanent memory takes a write until the next reset; packets with a wrong checksum, or broken off by
silence, are ignored. Not modelled: speed, acceleration, gains, the offset of the position, modes
without a goal (the motor stands still), registered writes, and the load at which a servo calls
itself overloaded: that is injected.
"""

from __future__ import annotations

from collections.abc import Iterable
from types import MappingProxyType
from typing import Final

from robot.drivers.servos.feetech_packets import Decoder, encode
from robot.drivers.servos.servo_packets import BROADCAST, Instruction, Packet
from sim_robot.electronics.bus_servos import LIMP, STEPS, BusServo, BusServos
from sim_robot.electronics.servos import Felt

BAUDS: Final = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)
"""Baud rates, by the value of register 6."""
VOLTAGE, OVERHEAT, OVERLOAD = 1 << 0, 1 << 2, 1 << 5
"""Bits of the status."""

ID, BAUD, DELAY, ANSWERS, MIN_ANGLE, MAX_ANGLE, MODE = 5, 6, 7, 8, 9, 11, 33
HOTTEST, HIGHEST_VOLTAGE, LOWEST_VOLTAGE, MOST_TORQUE, SWITCHES_OFF = 13, 14, 15, 16, 19
TORQUE, ACCELERATION, GOAL, SPEED, TORQUE_LIMIT, LOCK = 40, 41, 42, 46, 48, 55
POSITION, LOAD, VOLTS, HEAT, STATUS, MOVING, CURRENT = 56, 60, 62, 63, 65, 66, 69
SIZE: Final = 71
PERMANENT: Final = range(5, 40)
"""Addresses of the permanent memory (EEPROM)."""

_FACTORY: Final = MappingProxyType(
    {
        **{0: 3, 1: 9, 3: 9, 4: 3, ID: 1, BAUD: 0, DELAY: 0, ANSWERS: 1, MAX_ANGLE: 0xFF},
        **{MAX_ANGLE + 1: 0x0F, HOTTEST: 70, HIGHEST_VOLTAGE: 80, LOWEST_VOLTAGE: 40},
        **{MOST_TORQUE: 0xE8, MOST_TORQUE + 1: 0x03, SWITCHES_OFF: 0x2C, 20: 0x2F, 21: 32, 22: 32},
        **{24: 16, 26: 1, 27: 1, 34: 20, 35: 200, 36: 80},
    }
)
_MAX_SILENCE: Final = 0.02  # s of silence
_GOAL_TOLERANCE: Final = 23  # steps, 2°; a servo further away drives with all it has
_STALL_CURRENT: Final = 2.4  # A
_CURRENT_UNIT: Final = 0.0065  # A


class Servo(BusServo):
    """One servo: instructions in, answers out.

    Args:
        number: ID of the servo.

    Attributes:
        memory: Registers, by their addresses.
        permanent_writes: Number of times that a host wrote into the permanent memory.
    """

    USUAL = 74
    DIPPED = 36

    def __init__(self, number: int):
        super().__init__()
        self.memory = bytearray(SIZE)
        for address, value in _FACTORY.items():
            self.memory[address] = value
        self.memory[ID] = number
        self._kept = bytes(self.memory)
        self.permanent_writes = 0
        self._overloaded = False
        self._last_goal: float = STEPS / 2
        self.power_up()
        self.warm_up()

    def power_up(self) -> None:
        """Does what happens when the supply comes (back): memory begins anew, torque is off."""
        self.memory[PERMANENT[0] : PERMANENT[-1] + 1] = self._kept[PERMANENT[0] : PERMANENT[-1] + 1]
        self.memory[TORQUE:] = bytes(SIZE - TORQUE)
        self.memory[TORQUE_LIMIT : TORQUE_LIMIT + 2] = self.memory[MOST_TORQUE : MOST_TORQUE + 2]
        self.memory[LOCK] = 1
        self._overloaded = False
        self.set_word(GOAL, min(max(round(self.position), 0), STEPS - 1))
        self.switched_on = self.now()

    @property
    def number(self) -> int:
        """ID of the servo."""
        return self.memory[ID]

    @property
    def baud(self) -> int:
        """Baud rate at which the servo listens."""
        return BAUDS[self.memory[BAUD]]

    def word(self, address: int) -> int:
        """Number in two registers, low first."""
        return self.memory[address] + 256 * self.memory[address + 1]

    def set_word(self, address: int, value: int) -> None:
        """Sets the number in two registers, low first, as the maker's program could."""
        self.memory[address : address + 2] = value.to_bytes(2, "little")

    def keep(self) -> None:
        """Stores the permanent memory as it is, as the maker's program does when it unlocks it."""
        self._kept = bytes(self.memory)

    def overload(self) -> None:
        """Makes the servo find itself overloaded."""
        self._overloaded = True
        self.look()

    def send_to(self, position: int) -> None:
        """Moves the servo as another program would."""
        self.set_word(GOAL, position)
        self.memory[TORQUE] = 1

    def set_wheel(self, on: bool) -> None:
        """Sets wheel mode, or position mode again, as another program would; torque goes off."""
        self.memory[TORQUE], self.memory[MODE] = 0, int(on)

    def twin(self) -> Servo:
        """Another servo with the same ID, of another model."""
        twin = Servo(self.number)
        twin.memory[BAUD] = self.memory[BAUD]
        twin.memory[3] ^= 0x10
        twin.keep()
        twin.now = self.now
        twin.feel(Felt(self.position + 137, 0.0))
        return twin

    def look(self) -> None:
        """Brings status and torque up to date with the servo's condition."""
        low, high = self.memory[LOWEST_VOLTAGE], self.memory[HIGHEST_VOLTAGE]
        status = VOLTAGE * (not low <= self.volts <= high)
        status |= OVERHEAT * (self.heat > self.memory[HOTTEST]) | OVERLOAD * self._overloaded
        self.memory[STATUS] = status
        if status & self.memory[SWITCHES_OFF]:
            self.memory[TORQUE] = 0

    def driven_to(self) -> float:
        """The position that the motor drives to, in steps; ``LIMP`` where it has no torque."""
        self.look()
        if not self.memory[TORQUE]:
            return LIMP
        if not self.memory[MODE]:
            low, high = self.word(MIN_ANGLE), self.word(MAX_ANGLE)
            goal = self.word(GOAL)
            self._last_goal = min(max(goal, low), high) if high > low else goal
        return self._drives(self._last_goal)

    def answer(self, packet: Packet) -> Packet | None:
        """Acts on a packet for this servo alone; returns its answer, or ``None``."""
        if self.deaf:
            return None
        self._measure()
        parameters, status, contents = packet.parameters, self.memory[STATUS], b""
        match packet.instruction:
            case Instruction.PING:
                pass
            case Instruction.READ if len(parameters) == 2:
                first, count = parameters
                contents = bytes(self.memory[first : first + count]).ljust(count, b"\0")
            case Instruction.WRITE if parameters:
                self._write(parameters[0], parameters[1:])
                if packet.id == BROADCAST or not self.memory[ANSWERS]:
                    return None
                status = self.memory[STATUS]
            case _:
                return None
        return Packet(self.number, status, contents)

    def _write(self, first: int, data: bytes) -> None:
        old_goal = self.driven_to()
        written = range(first, min(first + len(data), POSITION))
        for address, value in zip(written, data, strict=False):
            if address >= PERMANENT[0]:
                self.memory[address] = value
        self.permanent_writes += any(address in PERMANENT for address in written)
        if GOAL in written and not self.memory[MODE]:
            self.memory[TORQUE] = 1
        if TORQUE in written:
            self._overloaded = False
        new_goal = self.driven_to()
        if GOAL in written and new_goal != LIMP:
            self.on_move(old_goal or self.position, new_goal)

    def _measure(self) -> None:
        """Brings the registers that can only be read up to date."""
        driven = self.driven_to()
        position, torque = self.position, self.torque
        miss = driven - position if driven else 0.0
        load = 0.0 if not driven else torque
        if abs(miss) > _GOAL_TOLERANCE:
            load = 1.0 if miss > 0 else -1.0
        self.set_word(POSITION, round(abs(position)) | (position < 0) << 15)
        self.set_word(LOAD, round(min(abs(load), 1.0) * 1000) | (load < 0) << 10)
        self.memory[VOLTS], self.memory[HEAT] = self.volts, self.heat
        self.memory[MOVING] = abs(miss) > _GOAL_TOLERANCE
        drawn = min(abs(torque), 1.0) if driven else 0.0
        self.set_word(CURRENT, round(drawn * _STALL_CURRENT / _CURRENT_UNIT))


class FeetechEmulator(BusServos[Servo]):
    """Servos on a serial line.

    Args:
        ids: IDs of the servos, in the order of the robot's joints.
        baud: Baud rate at which they listen, one of ``BAUDS``.
    """

    SYNC_HEAD = 2
    encode = staticmethod(encode)

    def __init__(self, ids: Iterable[int] = (1,), *, baud: int = BAUDS[0]):
        self._heard_at = 0.0
        super().__init__(map(Servo, ids), Decoder())
        for servo in self.servos:
            servo.memory[BAUD] = BAUDS.index(baud)
            servo.keep()

    def receive(self, data: bytes) -> bytes:
        """Gives bytes to the servos; a packet that silence broke off is forgotten before."""
        now = self.servos[0].now()
        if now - self._heard_at > _MAX_SILENCE:
            self._decoder.begin()
        self._heard_at = now
        return super().receive(data)
