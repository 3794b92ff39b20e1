"""ROBOTIS DYNAMIXEL servos of the X series, on a half-duplex serial line (protocol 2.0).

A count is a position of the servo's encoder, 4096 to a turn. Everything that decides how a servo
moves on its own lies in its EEPROM, which is never written here: a servo that is not in position
mode, or whose torque goes on by itself, is refused with what to change in DYNAMIXEL Wizard.

What is written, besides goals and torque, is volatile: no acceleration, and a profile velocity a
little above the fastest that joints are moved at. So whoever commands a goal far away, that joint
does not fly there. A reset sets it to 0, and by that a servo that restarted is known.

A servo that switched its torque off, because it is overloaded or hot, needs a reboot before it
takes torque again. It is rebooted when it is set up, limp as it is, and refused if it complains
again. One that complains with its torque on is not: it would let go of what it holds. Of a supply
that dipped it goes on complaining for good; what its supply gives now is then believed instead.

Source: ROBOTIS e-Manual, XL430-W250, XL330-M288 and DYNAMIXEL Protocol 2.0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar, Final

import serial

from robot.drivers.buses import Buses
from robot.drivers.links.device_files import readers
from robot.drivers.links.serial_line import SerialLine
from robot.drivers.servos.answering_servos import AnsweringServos, Registers
from robot.drivers.servos.dynamixel_packets import (
    ALERT,
    OVERHEAD,
    Decoder,
    Instruction,
    Packet,
    PacketError,
    encode,
    read,
    sync_read,
    sync_write,
    write,
)
from robot.drivers.servos.servo_bus import ServoState
from robot.errors import DeviceDataError, DeviceError, DeviceTimeoutError
from robot.host.clock import Clock
from robot.toml_sections import Section

NAME: Final = "DYNAMIXEL"
BAUDS: Final = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)
COUNTS: Final = range(1, 4096)
"""Positions of a turn; 0 means limp here, and is left out."""
OUTPUTS: Final = range(1, 253)
"""The ids that a servo can have, and that joints name."""
TOP_SPEED: Final = 55
"""The profile velocity: 75°/s."""

MODELS: Final = MappingProxyType(
    {
        **{30: "MX-28", 311: "MX-64", 321: "MX-106"},  # with their firmware for protocol 2.0
        **{1000: "XH430-W350", 1001: "XD430-T350", 1010: "XH430-W210", 1011: "XD430-T210"},
        **{1020: "XM430-W350", 1030: "XM430-W210", 1040: "XH430-V350", 1050: "XH430-V210"},
        **{1060: "XL430-W250", 1070: "XC430-W150", 1080: "XC430-W240", 1090: "2XL430-W250"},
        **{1100: "XH540-W270", 1101: "XD540-T270", 1110: "XH540-W150", 1111: "XD540-T150"},
        **{1120: "XM540-W270", 1130: "XM540-W150", 1140: "XH540-V270", 1150: "XH540-V150"},
        **{1160: "2XC430-W250", 1170: "XW540-T260", 1180: "XW540-T140", 1190: "XL330-M077"},
        **{1200: "XL330-M288", 1210: "XC330-T181", 1220: "XC330-T288", 1230: "XC330-M181"},
        **{1240: "XC330-M288", 1270: "XW430-T333", 1310: "XW540-H260"},
    }
)
"""The models with this control table, by their numbers."""

_SAY_NO_CURRENT: Final = frozenset((30, 1060, 1070, 1080, 1090, 1160))
_CURRENT_UNITS: Final = MappingProxyType(  # A; of the models that are not here 2.69 mA
    dict.fromkeys(range(1190, 1241), 1e-3) | dict.fromkeys((311, 321), 3.36e-3)
)
_SUPPLY: Final = 0x01
_FAULTS: Final = MappingProxyType(
    {
        _SUPPLY: "a supply out of its limits",
        0x04: "overheating",
        0x08: "a failure of its encoder",
        0x10: "an electrical shock",
        0x20: "an overload",
    }
)
_MODES: Final = MappingProxyType(
    {0: "current", 1: "velocity (wheel)", 4: "multi-turn", 5: "current-based", 16: "PWM"}
)
_POSITION_MODE: Final = 3
_WIZARD: Final = "in DYNAMIXEL Wizard; nothing is written into an EEPROM here."

# Addresses of the control table. In one reading there may be no gap.
_EEPROM: Final = 7  # id, baud, return delay, drive mode, operating mode
_DRIVE_LIMITS: Final = 32  # the highest voltage, the lowest, the most PWM
_LIMITS: Final = 48  # the highest position, then the lowest
_STARTUP: Final = 60
_TORQUE: Final = 64
_RETURN_LEVEL: Final = 68
_HARDWARE_ERROR: Final = 70
_WATCHDOG: Final = 98
_ACCELERATION: Final = 108
_VELOCITY: Final = 112
_GOAL: Final = 116
_PWM: Final = 124
_CURRENT: Final = 126
_POSITION: Final = 132
_VOLTS: Final = 144
_TEMPERATURE: Final = 146
_STATE: Final = _VELOCITY
_STATE_END: Final = 147

_ATTEMPTS: Final = 3  # of a query; a sound line needs one, and the doctor counts the others
_DELAY_UNIT: Final = 2e-6  # s
_USUAL_DELAY: Final = 250
_REBOOT: Final = 0.5  # s; the manual gives no time
_REBOOTS: Final = 4  # times that


@dataclass(frozen=True, kw_only=True)
class DynamixelSettings:
    """The serial line to the servos; their outputs are their ids."""

    name: ClassVar = NAME
    counts: ClassVar = COUNTS
    outputs: ClassVar = OUTPUTS
    per_update: ClassVar = len(OUTPUTS)
    reads_back: ClassVar = True
    port: str = field(repr=False)  # a re-plugged adapter may have another name
    baud: int

    @classmethod
    def read(cls, table: Section) -> DynamixelSettings:
        """``port`` and ``baud``."""
        return cls(port=table.text("port"), baud=table.one_of("baud", BAUDS, 57600))

    def open(self, buses: Buses) -> AnsweringServos:
        """Opens the line; a servo is first heard of at its first query."""
        chain = DynamixelChain(lambda: buses.open_serial(self.port, self.baud), clock=buses.clock)
        return AnsweringServos(chain, outputs=OUTPUTS, counts=COUNTS)

    def __str__(self) -> str:
        return f"{self.port}, {self.baud} baud"


@dataclass(frozen=True, kw_only=True)
class _Known:
    """What a servo that was set up said of itself.

    Attributes:
        most: The most drive that it gives: its PWM limit.
        unit: Of the current that it tells, A; 0 where it tells none.
        delay: Before it answers, s.
        limits: The goals that it takes.
        volts: What its supply may give, 0.1 V.
    """

    most: int
    unit: float
    delay: float
    limits: tuple[int, int]
    volts: tuple[int, int]


class DynamixelChain:
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
        reply_timeout: float = 0.2,
    ):
        self.repeats = 0
        self._clock = clock
        self._decoder = Decoder()
        self._known: dict[int, _Known] = {}
        self._reply_timeout = reply_timeout
        self._line = SerialLine(open_port, clock=clock, reply_timeout=reply_timeout)

    @property
    def bytes_written(self) -> int:
        """Bytes handed to the line, for a clock that must know when emulated servos have them."""
        return self._line.bytes_written

    def ping(self, servo: int) -> bool:
        """Whether a servo answers, asked once; also with a damaged answer, as of two at once."""
        found: dict[int, bytes] = {}
        damaged = self._ask(Packet(servo, Instruction.PING), [servo], 3, found)
        return damaged or servo in found

    def set_up(self, servo: int) -> None:
        """Identifies a servo, refuses one that is not fit for use, and limits its speed.

        Raises:
            DeviceError: It does not answer, is no X servo, is set up for something else or failed.
        """
        model = int.from_bytes(self._one(servo, Packet(servo, Instruction.PING), 3)[:2], "little")
        if model not in MODELS:
            raise self._unfit(
                servo, f"is a model {model}, whose registers are not known", "Use an X servo."
            )
        self._line.write(encode(sync_write(_RETURN_LEVEL, {servo: 2}, 1)))
        _, _, delay, drive, mode = self._bytes(servo, _EEPROM, 5)
        if mode != _POSITION_MODE:
            raise self._unfit(
                servo,
                f"is in {_MODES.get(mode, f'the unknown operating mode {mode}')} mode, not in "
                "position mode",
                f"Set its Operating Mode to 3 {_WIZARD}",
            )
        if drive & ~1:  # which only turns it round
            raise self._unfit(
                servo,
                f"has Drive Mode {drive}: a profile by time, or torque that goes on with a goal",
                f"Set its Drive Mode to 0 or 1 {_WIZARD}",
            )
        if self._bytes(servo, _STARTUP, 1)[0]:
            raise self._unfit(
                servo,
                "switches its torque on, or restores its memory, by itself after a reset",
                f"Set its Startup Configuration to 0 {_WIZARD}",
            )
        limits = self._bytes(servo, _LIMITS, 8)
        highest, lowest = (int.from_bytes(limits[at : at + 4], "little") for at in (0, 4))
        table = self._bytes(servo, _DRIVE_LIMITS, 6)
        most_volts, least_volts, most = (
            int.from_bytes(table[at : at + 2], "little") for at in (0, 2, 4)
        )
        self._known[servo] = _Known(
            most=max(most, 1),
            unit=0.0 if model in _SAY_NO_CURRENT else _CURRENT_UNITS.get(model, 2.69e-3),
            delay=delay * _DELAY_UNIT,
            limits=(lowest, highest),
            volts=(least_volts, most_volts),
        )
        (error,), (torque,) = (self._bytes(servo, at, 1) for at in (_HARDWARE_ERROR, _TORQUE))
        if error and not torque:
            self._reboot(servo)
        for address, value, size in (
            (_WATCHDOG, 0, 1),
            (_ACCELERATION, 0, 4),
            (_VELOCITY, TOP_SPEED, 4),
        ):
            self._one(servo, write(servo, address, value, size), 0)

    def read(self, servos: Sequence[int]) -> dict[int, Registers]:
        """Goal, speed and state of some servos, in two queries for all of them.

        Raises:
            DeviceTimeoutError: One does not answer.
            DeviceDataError: What one answers is damaged, or a refusal.
            DeviceMissingError: The line failed.
        """
        state = self._all(servos, _STATE, _STATE_END - _STATE)
        torque = self._all(servos, _TORQUE, 1)
        alerted = [n for n in servos if (state[n][0] | torque[n][0]) & ALERT]
        errors = dict.fromkeys(servos, b"\0\0") | self._all(alerted, _HARDWARE_ERROR, 1)
        return {n: self._registers(n, state[n][1:], torque[n][1], errors[n][1]) for n in servos}

    def send(self, goals: Mapping[int, int]) -> None:
        """Writes goals, in one packet.

        Raises:
            DeviceError: The line failed.
        """
        self._line.write(encode(sync_write(_GOAL, goals, 4)))

    def switch(self, servos: Sequence[int], *, on: bool) -> None:
        """Switches torque, in one packet.

        Raises:
            DeviceError: The line failed.
        """
        self._line.write(encode(sync_write(_TORQUE, dict.fromkeys(servos, int(on)), 1)))

    def seconds_for(self, servos: int) -> float:
        """How long reading and sending to so many servos takes, s."""
        state = 1 + _STATE_END - _STATE
        sent = 3 * len(encode(sync_read(0, 0, ()))) + servos * (1 + 1 + 5)
        delay = max((known.delay for known in self._known.values()), default=_USUAL_DELAY * 2e-6)
        answers = servos * (2 * OVERHEAD + state)
        return self._line.seconds_for(sent + answers) + 2 * servos * delay

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

    def _registers(self, servo: int, state: bytes, torque: int, error: int) -> Registers:
        def number(address: int, size: int) -> int:
            start = address - _STATE
            return int.from_bytes(state[start : start + size], "little", signed=True)

        known, volts = self._known.get(servo), number(_VOLTS, 2)
        if known and torque and known.volts[0] <= volts <= known.volts[1]:
            error &= ~_SUPPLY  # a dip that is over, and for which nothing was switched off
        return Registers(
            goal=number(_GOAL, 4),
            marked=number(_VELOCITY, 4) == TOP_SPEED,
            state=ServoState(
                position=number(_POSITION, 4),
                driven=bool(torque),
                fault=_in_words(error),
                load=number(_PWM, 2) / known.most if known else None,
                voltage=volts / 10,
                temperature=number(_TEMPERATURE, 1),
                current=abs(number(_CURRENT, 2)) * known.unit if known and known.unit else None,
                limits=known.limits if known else None,
            ),
        )

    def _reboot(self, servo: int) -> None:
        self._one(servo, Packet(servo, Instruction.REBOOT), 0)
        for _ in range(_REBOOTS):
            self._clock.sleep(_REBOOT)
            if self.ping(servo):
                break
        (again,) = self._bytes(servo, _HARDWARE_ERROR, 1)
        if again:
            raise self._unfit(
                servo,
                f"reports {_in_words(again)}, also after a reboot, and has its torque off",
                "Relieve it, let it cool for 20 minutes and check its supply.",
            )

    def _bytes(self, servo: int, address: int, size: int) -> bytes:
        return self._one(servo, read(servo, address, size), size)

    def _one(self, servo: int, packet: Packet, size: int) -> bytes:
        """What one servo answers, without its error."""
        return self._query(lambda _: packet, [servo], size)[servo][1:]

    def _all(self, servos: Sequence[int], address: int, size: int) -> dict[int, bytes]:
        return self._query(lambda missing: sync_read(address, size, missing), servos, size)

    def _query(
        self, question: Callable[[Sequence[int]], Packet], servos: Iterable[int], size: int
    ) -> dict[int, bytes]:
        """Asks, and asks again those whose sound answer did not come; the error comes first."""
        answers: dict[int, bytes] = {}
        wanted = list(servos)
        damaged = False
        for attempt in range(_ATTEMPTS):
            missing = [servo for servo in wanted if servo not in answers]
            if not missing:
                break
            self.repeats += attempt > 0
            damaged = self._ask(question(missing), missing, size, answers)
        for servo in wanted:
            if servo not in answers:
                raise self._unanswered(servo, damaged)
            error = answers[servo][0] & ~ALERT
            if error or len(answers[servo]) != 1 + size:
                said = PacketError(error).name if error in list(PacketError) else f"error {error}"
                raise self._unfit(
                    servo,
                    f"refused {question([servo])}: {said.lower().replace('_', ' ')}",
                    "Check that its firmware is current.",
                )
        return answers

    def _ask(
        self, packet: Packet, servos: Sequence[int], size: int, answers: dict[int, bytes]
    ) -> bool:
        """Asks once; adds the answers that come, and returns whether something else did.

        Servos answer in the order in which they were asked.
        """
        self._line.clear()
        self._decoder.clear()
        before = self._decoder.damaged
        self._line.write(encode(packet))
        missing = set(servos)
        left = len(servos) * (OVERHEAD + size)
        while servos[-1] in missing and (left > 0 or self._decoder.damaged == before):
            wanted = max(1, OVERHEAD + size - self._decoder.pending)
            data = self._line.read(wanted)
            left -= len(data)
            for answer in self._decoder.feed(data):
                status = answer.instruction == Instruction.STATUS
                if status and answer.id in missing and answer.parameters:
                    answers[answer.id] = answer.parameters
                    missing.remove(answer.id)
                    known = self._known.get(answer.id)
                    self._clock.charge(known.delay if known else _USUAL_DELAY * _DELAY_UNIT)
            if len(data) < wanted:
                break
        return self._decoder.damaged > before or bool(self._decoder.pending)

    def _unanswered(self, servo: int, damaged: bool) -> DeviceError:
        who = readers(self._line.port)
        if damaged:
            return DeviceDataError(
                f"What servo {servo} ({self.name}) answers is damaged: two servos have this id, or "
                "the line is bad.",
                f"Connect them to {self._line.port} one by one; check cable and ground, and {who}",
            )
        return DeviceTimeoutError(
            f"Servo {servo} ({self.name}) does not answer within {self._reply_timeout:g} s.",
            "Check its id and baud rate (robotd scan lists who answers), its cable and the "
            "servos' supply, and " + who,
        )

    def _unfit(self, servo: int, what: str, advice: str) -> DeviceDataError:
        return DeviceDataError(f"Servo {servo} ({self.name}) {what}.", advice)


def _in_words(error: int) -> str:
    """A hardware error; empty for none."""
    words = [words for bit, words in _FAULTS.items() if error & bit]
    return " and ".join(words) or (f"the hardware error {error}" if error else "")
