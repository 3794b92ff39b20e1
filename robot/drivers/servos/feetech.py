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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from robot.drivers.servos.answering_servos import AnsweringServoSettings
from robot.drivers.servos.feetech_packets import OVERHEAD, Decoder, encode
from robot.drivers.servos.servo_bus import ServoState
from robot.drivers.servos.servo_chain import Chain, Registers
from robot.drivers.servos.servo_packets import BROADCAST, Instruction, Packet

TOP_SPEED: Final = 1024
"""Speed that is sent with each goal, steps/s: 90°/s, well above the speed of a slew."""
MARK: Final = 213
"""Acceleration that is the mark, in 100 steps/s²: 1900°/s²."""

FAULTS: Final = (
    (0, "voltage"),
    (1, "encoder"),
    (2, "overheat"),
    (3, "overcurrent"),
    (5, "overload"),
)
"""Bits of the status, and what each of them says."""

_LAST: Final = 4095  # position of a turn
_LIMITS, _MODE = 9, 33
_TORQUE, _ACCELERATION, _GOAL = 40, 41, 42
_STATE: Final = range(_TORQUE, 71)
_SETTINGS: Final = range(5, 34)
_DELAY: Final = 7  # register of the delay of an answer, in units of 2 µs
_CURRENT_UNIT: Final = 0.0065  # A
_MODES: Final = ("position", "wheel (constant speed)", "open loop (PWM)", "step")
_SETTLE_TIME: Final = 0.002  # s after a write until a reading shows it


class FeetechChain(Chain[tuple[int, int]]):
    """The servos of one line, of each of which the limits of its goals are known."""

    name = "Feetech"
    overhead = OVERHEAD
    decoder = Decoder

    def ping(self, servo: int) -> bool:
        """Whether a servo answers, asked once; a damaged answer, as of two at once, counts."""
        # Not the protocol's PING: a servo with a voltage fault answers that with the very same
        # bytes, which would be taken for an echo.
        question = encode(Packet(servo, Instruction.READ, bytes((_SETTINGS[0], 1))))
        answers, damaged = self._ask(question, [servo], 1)
        return servo in answers or damaged

    def set_up(self, servos: Sequence[int]) -> None:
        """Identifies servos, refuses one that is not fit for use, and marks them."""
        settings = self._read_all(servos, _SETTINGS)
        for servo in servos:
            memory = dict(zip(_SETTINGS, settings[servo], strict=True))
            mode = memory[_MODE]
            if mode:
                mode_name = _MODES[mode] if mode < len(_MODES) else f"unknown ({mode})"
                raise self._unfit(
                    servo,
                    f"is in {mode_name} mode, register {_MODE}",
                    "Set its mode to 0 (position) with the maker's program; nothing is written "
                    "into its EEPROM here.",
                )
            low, high = (memory[at] + 256 * memory[at + 1] for at in (_LIMITS, _LIMITS + 2))
            self._known[servo] = (low, high) if high > low else (0, _LAST)  # both 0: none
            self._delays[servo] = 2e-6 * memory[_DELAY]
        states = {n: registers.state for n, registers in self.read(servos).items()}
        tripped = {n: b"\0" for n, state in states.items() if state.fault and not state.driven}
        if tripped:
            self._write(_TORQUE, tripped)  # acknowledges an overload that is over
        self._write(_ACCELERATION, dict.fromkeys(servos, bytes((MARK,))))
        self._clock.sleep(_SETTLE_TIME)

    def read(self, servos: Sequence[int]) -> dict[int, Registers]:
        """Goal, torque and state of some servos, in one query for all of them."""
        answers = self._read_all(servos, _STATE)
        return {servo: self._registers(servo, answers[servo]) for servo in servos}

    def send(self, goals: Mapping[int, int]) -> None:
        """Writes goals with their speed, in one packet, which also switches the torque on."""
        speed = _low_first(TOP_SPEED)
        self._write(_GOAL, {n: _low_first(goal) + b"\0\0" + speed for n, goal in goals.items()})

    def switch(self, servos: Sequence[int], *, on: bool) -> None:
        """Switches torque, in one packet."""
        self._write(_TORQUE, dict.fromkeys(servos, bytes((on,))))
        self._clock.sleep(_SETTLE_TIME)

    def seconds_for(self, servos: int) -> float:
        """Time that reading so many servos and sending to them takes, s."""
        asked = OVERHEAD + 2 + servos
        answered = servos * (OVERHEAD + len(_STATE))
        sent = OVERHEAD + 2 + 7 * servos
        return self._line.seconds_for(asked + answered + sent) + self._delay(servos)

    def _registers(self, servo: int, data: bytes) -> Registers:
        def number(address: int, sign: int = 15) -> int:
            """Number in two bytes, low first, whose sign is a bit of its own."""
            start = address - _STATE[0]
            value = data[start] + 256 * data[start + 1]
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
                fault=" and ".join(fault for bit, fault in FAULTS if status >> bit & 1),
                load=number(60, sign=10) / 1000,
                voltage=byte(62) / 10,
                temperature=byte(63),
                current=abs(number(69)) * _CURRENT_UNIT,
                limits=self._known.get(servo),
            ),
        )

    def _write(self, address: int, data: Mapping[int, bytes]) -> None:
        """Writes into several servos' memory, which none of them acknowledges."""
        size = len(next(iter(data.values()), b""))
        values = b"".join(bytes((servo,)) + value for servo, value in data.items())
        parameters = bytes((address, size)) + values
        self._line.write(encode(Packet(BROADCAST, Instruction.SYNC_WRITE, parameters)))

    def _read_all(self, servos: Sequence[int], addresses: range) -> dict[int, bytes]:
        """Reads the bytes at some addresses of each servo."""
        block = bytes((addresses[0], len(addresses)))

        def question(missing: Sequence[int]) -> bytes:
            if len(missing) == 1:
                return encode(Packet(missing[0], Instruction.READ, block))
            return encode(Packet(BROADCAST, Instruction.SYNC_READ, block + bytes(missing)))

        answers = self._query(question, servos, len(addresses))
        return {servo: answer[1:] for servo, answer in answers.items()}


def _low_first(value: int) -> bytes:
    return value.to_bytes(2, "little")


@dataclass(frozen=True, kw_only=True)
class FeetechSettings(AnsweringServoSettings):
    """The serial line to the servos; their outputs are their IDs."""

    name = FeetechChain.name
    outputs = range(1, 254)
    bauds = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)
    usual_baud = 1_000_000
    chain = FeetechChain
