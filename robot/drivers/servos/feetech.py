"""Feetech STS and SMS servos (STS3215 and its like) on a half-duplex serial line.

A count is a position of the servo's encoder, 4096 to a turn. The permanent memory is never written:
a servo that does not run as position servo is refused, with what to change in the maker's program.

A goal alone switches the torque on, in these servos; so none is sent to one that was not read a
moment before. Each goal carries the speed at which the servo may go there. The mark is an
acceleration so high that it does not matter: a reset sets it to 0.

Sources: Feetech, memory table of the STS and SMS series and its protocol manual; that a goal
switches the torque on, and is cut to the limits without a word, is reported by those who tried.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Final

import serial

from robot.drivers.buses import Buses
from robot.drivers.links.device_files import readers
from robot.drivers.links.serial_line import SerialLine
from robot.drivers.servos.answering_servos import AnsweringServos, Registers
from robot.drivers.servos.servo_bus import ServoState
from robot.errors import DeviceDataError, DeviceError, DeviceTimeoutError
from robot.host.clock import Clock
from robot.toml_sections import Section

NAME: Final = "Feetech"
BAUDS: Final = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)
"""In the order of the numbers that register 6 has for them."""
COUNTS: Final = range(1, 4096)
"""Positions of a turn; 0 means limp here, and is left out."""
OUTPUTS: Final = range(1, 254)
"""The IDs that a servo can have, and that joints name."""
TOP_SPEED: Final = 1024
"""Sent with each goal, steps/s: 90°/s, well above the speed of a slew."""
MARK: Final = 213
"""The acceleration, in 100 steps/s²: 1900°/s²."""

FAULTS: Final = (
    (0, "voltage"),
    (1, "encoder"),
    (2, "overheat"),
    (3, "overcurrent"),
    (5, "overload"),
)
"""Bits of the status, and what each of them says."""

_EVERYBODY: Final = 0xFE
_HEADER: Final = b"\xff\xff"
_OVERHEAD: Final = 6  # bytes of a packet around its parameters
_PING, _READ, _WRITE, _SYNC_READ, _SYNC_WRITE = 0x01, 0x02, 0x03, 0x82, 0x83
_LIMITS, _MODE = 9, 33
_TORQUE, _ACCELERATION, _GOAL = 40, 41, 42
_STATE: Final = range(_TORQUE, 71)
_SETTINGS: Final = range(5, 34)
_DELAY: Final = 7  # of an answer, in units of 2 µs
_CURRENT_UNIT: Final = 0.0065  # A
_MODES: Final = ("position", "wheel (constant speed)", "open loop (PWM)", "step")
_ATTEMPTS: Final = 3  # of a query; a sound line needs one, and the doctor counts the others
_SETTLED: Final = 0.002  # s after a write until a reading shows it


@dataclass(frozen=True, kw_only=True)
class FeetechSettings:
    """The serial line to the servos."""

    name: ClassVar = NAME
    counts: ClassVar = COUNTS
    outputs: ClassVar = OUTPUTS
    per_update: ClassVar = len(OUTPUTS)
    reads_back: ClassVar = True
    port: str = field(repr=False)  # a re-plugged adapter may have another name
    baud: int

    @classmethod
    def read(cls, table: Section) -> FeetechSettings:
        """``port`` and ``baud``."""
        return cls(port=table.text("port"), baud=table.one_of("baud", BAUDS, BAUDS[0]))

    def open(self, buses: Buses) -> AnsweringServos:
        """Opens the line; a servo is first heard of at its first query."""
        chain = FeetechChain(lambda: buses.open_serial(self.port, self.baud), clock=buses.clock)
        return AnsweringServos(chain, outputs=OUTPUTS, counts=COUNTS)

    def __str__(self) -> str:
        return f"{self.port}, {self.baud} baud"


class FeetechChain:
    """The servos of one line, as ``AnsweringServos`` uses them.

    Args:
        open_port: Opens the line, which this object closes.
        clock: Paces the packets.
        reply_timeout: Longest wait for an answer, s.

    Attributes:
        name: What they are called in sentences.
        repeats: Queries that had to be asked again, because an answer was damaged or did not come.
    """

    name = NAME

    def __init__(
        self,
        open_port: Callable[[], serial.Serial],
        *,
        clock: Clock,
        reply_timeout: float = 0.05,
    ):
        self.repeats = 0
        self._clock = clock
        self._limits: dict[int, tuple[int, int]] = {}
        self._delay = 0.0  # the longest of the servos', s
        self._line = SerialLine(open_port, clock=clock, reply_timeout=reply_timeout)

    @property
    def bytes_written(self) -> int:
        """Bytes handed to the line, for a clock that must know when emulated servos have them."""
        return self._line.bytes_written

    def ping(self, servo: int) -> bool:
        """Whether a servo answers, asked once; also with a damaged answer, as of two at once."""
        sound, damaged = self._answers(_packet(servo, _PING), [servo], 0)
        return servo in sound or damaged

    def set_up(self, servo: int) -> None:
        """Identifies a servo, refuses one that is not fit for use, and marks it.

        Raises:
            DeviceTimeoutError: It does not answer.
            DeviceDataError: Its answers are damaged, or it is set up for something else.
            DeviceMissingError: The line failed.
        """
        memory = dict(zip(_SETTINGS, self._one(servo, _SETTINGS), strict=True))
        mode = memory[_MODE]
        if mode:
            what = _MODES[mode] if mode < len(_MODES) else f"unknown ({mode})"
            raise self._unfit(
                servo,
                f"is in {what} mode, register {_MODE}",
                "Set its mode to 0 (position) with the maker's program; nothing is written into "
                "its EEPROM here.",
            )
        low, high = (memory[at] + 256 * memory[at + 1] for at in (_LIMITS, _LIMITS + 2))
        self._limits[servo] = (low, high) if high > low else (0, COUNTS[-1])  # none if both are 0
        self._delay = max(self._delay, 2e-6 * memory[_DELAY])
        found = self._registers(servo, self._one(servo, _STATE))
        if found.state.fault and not found.state.driven:
            self._write(_TORQUE, {servo: b"\0"})  # acknowledges an overload that is over
        self._write(_ACCELERATION, {servo: bytes((MARK,))})
        self._clock.sleep(_SETTLED)

    def read(self, servos: Sequence[int]) -> dict[int, Registers]:
        """Goal, torque and state of some servos, in one query for all of them.

        Raises:
            DeviceTimeoutError: One does not answer.
            DeviceDataError: What one answers is damaged.
            DeviceMissingError: The line failed.
        """
        found = self._query(servos, _STATE)
        return {servo: self._registers(servo, found[servo]) for servo in servos}

    def send(self, goals: Mapping[int, int]) -> None:
        """Writes goals with their speed, in one packet; torque goes on by that.

        Raises:
            DeviceError: The line failed.
        """
        speed = _low_first(TOP_SPEED)
        self._write(_GOAL, {n: _low_first(goal) + b"\0\0" + speed for n, goal in goals.items()})

    def switch(self, servos: Sequence[int], *, on: bool) -> None:
        """Switches torque, in one packet.

        Raises:
            DeviceError: The line failed.
        """
        self._write(_TORQUE, dict.fromkeys(servos, bytes((on,))))
        self._clock.sleep(_SETTLED)

    def seconds_for(self, servos: int) -> float:
        """How long reading and sending to so many servos takes, s."""
        asked = _OVERHEAD + 2 + servos
        answered = servos * (_OVERHEAD + len(_STATE))
        sent = _OVERHEAD + 2 + 7 * servos
        return self._line.seconds_for(asked + answered + sent) + servos * self._delay

    def reopen(self) -> None:
        """Closes the line and opens it anew.

        Raises:
            DeviceMissingError: It cannot be opened.
        """
        self._line.close()
        self._line.open()

    def close(self) -> None:
        """Closes the line; the servos hold their goals."""
        self._line.close()

    def _registers(self, servo: int, data: bytes) -> Registers:
        def number(address: int, sign: int = 15) -> int:
            """Two bytes, low first, with their sign in a bit of its own."""
            at = address - _STATE[0]
            value = data[at] + 256 * data[at + 1]
            size = value & ~(1 << sign)
            return -size if value >> sign & 1 else size

        def byte(address: int) -> int:
            return data[address - _STATE[0]]

        status = byte(65)
        return Registers(
            goal=number(_GOAL),
            marked=byte(_ACCELERATION) == MARK,
            state=ServoState(
                position=number(56),
                driven=bool(byte(_TORQUE)),
                fault=" and ".join(what for bit, what in FAULTS if status >> bit & 1),
                load=number(60, sign=10) / 1000,
                voltage=byte(62) / 10,
                temperature=byte(63),
                current=abs(number(69)) * _CURRENT_UNIT,
                limits=self._limits.get(servo),
            ),
        )

    def _write(self, address: int, data: Mapping[int, bytes]) -> None:
        """Writes into several servos' memory, which none of them acknowledges."""
        size = len(next(iter(data.values()), b""))
        values = b"".join(bytes((servo,)) + value for servo, value in data.items())
        self._line.write(_packet(_EVERYBODY, _SYNC_WRITE, bytes((address, size)) + values))

    def _one(self, servo: int, addresses: range) -> bytes:
        return self._query([servo], addresses)[servo]

    def _query(self, servos: Sequence[int], addresses: range) -> dict[int, bytes]:
        """Asks, and asks again those whose sound answer did not come."""
        found: dict[int, bytes] = {}
        where = bytes((addresses[0], len(addresses)))
        damaged = False
        for attempt in range(_ATTEMPTS):
            missing = [servo for servo in servos if servo not in found]
            if not missing:
                return found
            self.repeats += attempt > 0
            if len(missing) == 1:
                packet = _packet(missing[0], _READ, where)
            else:
                packet = _packet(_EVERYBODY, _SYNC_READ, where + bytes(missing))
            answers, damaged = self._answers(packet, missing, len(addresses))
            found |= {servo: answers[servo] for servo in missing if servo in answers}
        missing = [servo for servo in servos if servo not in found]
        if missing:
            raise self._unanswered(missing[0], damaged=damaged)
        return found

    def _answers(
        self, packet: bytes, servos: Sequence[int], size: int
    ) -> tuple[dict[int, bytes], bool]:
        """Sends a question; the sound answers by servo, and whether something else came.

        Servos answer in the order in which they were asked.
        """
        self._line.clear()
        self._line.write(packet)
        answers: dict[int, bytes] = {}
        raw = bytearray()
        damaged = False
        left = len(servos) * (_OVERHEAD + size)
        while servos[-1] not in answers and left > 0:
            wanted = max(1, _OVERHEAD + size - len(raw))
            data = self._line.read(wanted)
            raw += data
            left -= len(data)
            for whole in _packets(raw):
                if whole == packet or whole[2] == _EVERYBODY:
                    left += len(whole)  # some adapters give back what was sent
                elif len(whole) == _OVERHEAD + size and whole[2] in servos:
                    answers[whole[2]] = whole[5:-1]
                else:
                    damaged = True
            if len(data) < wanted:
                break
        self._clock.charge(len(servos) * self._delay)
        return answers, damaged or bool(raw) or left <= 0

    def _unanswered(self, servo: int, *, damaged: bool) -> DeviceError:
        who = readers(self._line.port)
        if damaged:
            return DeviceDataError(
                f"What servo {servo} ({self.name}) answers is damaged: two servos have this ID, or "
                "the line is bad.",
                f"Connect them one by one to {self._line.port}; check the cable and the ground, "
                f"and {who}",
            )
        return DeviceTimeoutError(
            f"Servo {servo} ({self.name}) does not answer.",
            "Check its ID and baud rate (robotd scan lists who answers), its plug and the servos' "
            f"supply, and {who}",
        )

    def _unfit(self, servo: int, what: str, advice: str) -> DeviceDataError:
        return DeviceDataError(f"Servo {servo} ({self.name}) {what}.", advice)


def _packet(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Header, ID, length, instruction or error, parameters, checksum."""
    body = bytes((servo, len(parameters) + 2, instruction)) + parameters
    return _HEADER + body + bytes((~sum(body) & 0xFF,))


def _packets(raw: bytearray) -> Iterator[bytes]:
    """Takes the whole packets out of what came, and what is none at their front."""
    while len(raw) >= _OVERHEAD:
        end = raw[3] + 4
        if not raw.startswith(_HEADER) or end < _OVERHEAD:
            del raw[:1]
        elif len(raw) < end:
            return
        elif ~sum(raw[2 : end - 1]) & 0xFF != raw[end - 1]:
            del raw[:1]
        else:
            yield bytes(raw[:end])
            del raw[:end]


def _low_first(value: int) -> bytes:
    return value.to_bytes(2, "little")
