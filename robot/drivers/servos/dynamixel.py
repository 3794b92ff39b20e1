"""ROBOTIS DYNAMIXEL servos of the X series, on a half-duplex serial line (protocol 2.0).

A count is a position of the servo's encoder, 4096 to a turn. Everything that decides how a servo
moves on its own lies in its EEPROM, which is never written here: a servo that is not in position
mode, or whose torque goes on by itself, is refused with what to change in DYNAMIXEL Wizard.

What is written, besides goals and torque, is volatile: no profile acceleration, and a profile
velocity a little above the fastest at which joints are moved, so that a joint whose goal is far
away does not fly there. A reset sets the velocity to 0, and by that a servo that restarted is
known.

A servo that switched its torque off, because it is overloaded or hot, needs a reboot before it
takes torque again. It is rebooted when it is set up, limp as it is, and refused if it complains
again. One that complains with its torque on is not rebooted: it would let go of what it holds.
After a dip of its supply a servo goes on complaining for good; its present voltage is then believed
instead.

Source: ROBOTIS e-Manual, XL430-W250, XL330-M288 and DYNAMIXEL Protocol 2.0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from robot.drivers.servos.answering_servos import AnsweringServoSettings
from robot.drivers.servos.dynamixel_packets import (
    ALERT,
    OVERHEAD,
    Decoder,
    PacketError,
    encode,
    read,
    sync_read,
    sync_write,
)
from robot.drivers.servos.servo_bus import ServoState
from robot.drivers.servos.servo_chain import Chain, Registers
from robot.drivers.servos.servo_packets import Instruction, Packet

TOP_SPEED: Final = 55
"""Profile velocity, in the servo's unit: 75°/s."""

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
"""Names of the models with this control table, by their numbers."""

_WITHOUT_CURRENT: Final = frozenset((30, 1060, 1070, 1080, 1090, 1160))
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
_WIZARD_ADVICE: Final = "in DYNAMIXEL Wizard; nothing is written into an EEPROM here."

# Addresses of the control table. One reading must not span a gap.
_IDENTITY: Final = 0  # to 11: model (2), 7 ID, 8 baud, 9 return delay, 10 drive mode, 11 mode
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

_DELAY_UNIT: Final = 2e-6  # s
_REBOOT_TIME: Final = 0.3  # s; the manual gives no time
_REBOOT_WAITS: Final = 4  # times that long, at most
_SENDINGS: Final = 4  # times that a packet that nobody acknowledges is sent, at most


@dataclass(frozen=True, kw_only=True)
class _Known:
    """What a servo that was set up said of itself.

    Attributes:
        most: Largest drive of the servo: its PWM limit.
        unit: Unit of the current that it tells, A; 0 where it tells none.
        limits: Lowest and highest goal that it takes.
        volts: Lowest and highest voltage that its supply may have, 0.1 V.
    """

    most: int
    unit: float
    limits: tuple[int, int]
    volts: tuple[int, int]


class DynamixelChain(Chain[_Known]):
    """The servos of one line, as ``AnsweringServos`` uses them."""

    name = "DYNAMIXEL"
    overhead = OVERHEAD
    decoder = Decoder

    def ping(self, servo: int) -> bool:
        """Whether a servo answers, asked once; a damaged answer, as of two at once, counts."""
        answers, damaged = self._ask(encode(Packet(servo, Instruction.PING)), [servo], 3)
        return servo in answers or damaged

    def set_up(self, servos: Sequence[int]) -> None:
        """Identifies servos, refuses one that is not fit for use, and limits their speed."""
        self._write(_RETURN_LEVEL, servos, 2, 1)
        identities = self._read_all(servos, _IDENTITY, 12)
        limits = self._read_all(servos, _LIMITS, 8)
        drives = self._read_all(servos, _DRIVE_LIMITS, 6)
        startup = self._read_all(servos, _STARTUP, 1)
        for servo in servos:
            model = _numbers(identities[servo][1:], 2)[0]
            self._check(servo, model, *identities[servo][11:13], startup=startup[servo][1])
            highest, lowest = _numbers(limits[servo][1:], 4)
            most_volts, least_volts, most_pwm = _numbers(drives[servo][1:], 2)
            self._delays[servo] = identities[servo][10] * _DELAY_UNIT
            self._known[servo] = _Known(
                most=max(most_pwm, 1),
                unit=0.0 if model in _WITHOUT_CURRENT else _CURRENT_UNITS.get(model, 2.69e-3),
                limits=(lowest, highest),
                volts=(least_volts, most_volts),
            )
        torque = self._read_all(servos, _TORQUE, 1)
        errors = self._read_all(servos, _HARDWARE_ERROR, 1)
        tripped = [servo for servo in servos if errors[servo][1] and not torque[servo][1]]
        if tripped:
            self._reboot(tripped)
        for _ in range(_SENDINGS):
            self._write(_WATCHDOG, servos, 0, 1)
            self._write(_ACCELERATION, servos, 0, 4)
            self._write(_VELOCITY, servos, TOP_SPEED, 4)
            profiles = self._read_all(servos, _ACCELERATION, 8)
            if all(_numbers(profile[1:], 4) == [0, TOP_SPEED] for profile in profiles.values()):
                break  # else a packet was damaged; if none arrives, the servo's speed shows it

    def read(self, servos: Sequence[int]) -> dict[int, Registers]:
        """Goal, speed and state of some servos, in two queries for all of them."""
        state = self._read_all(servos, _STATE, _STATE_END - _STATE)
        torque = self._read_all(servos, _TORQUE, 1)
        alerted = [n for n in servos if (state[n][0] | torque[n][0]) & ALERT]
        errors = dict.fromkeys(servos, b"\0\0") | self._read_all(alerted, _HARDWARE_ERROR, 1)
        return {n: self._registers(n, state[n][1:], torque[n][1], errors[n][1]) for n in servos}

    def send(self, goals: Mapping[int, int]) -> None:
        """Writes goals, in one packet."""
        self._line.write(encode(sync_write(_GOAL, goals, 4)))

    def switch(self, servos: Sequence[int], *, on: bool) -> None:
        """Switches torque, in one packet."""
        self._write(_TORQUE, servos, int(on), 1)

    def seconds_for(self, servos: int) -> float:
        """Time that reading so many servos and sending to them takes, s."""
        state = 1 + _STATE_END - _STATE
        sent = 3 * len(encode(sync_read(0, 0, ()))) + servos * (1 + 1 + 5)
        answers = servos * (2 * OVERHEAD + state)
        return self._line.seconds_for(sent + answers) + self._delay(2 * servos)

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

    def _check(self, servo: int, model: int, drive: int, mode: int, *, startup: int) -> None:
        """Refuses a servo that is not fit for use."""
        if model not in MODELS:
            raise self._unfit(
                servo, f"is a model {model}, whose registers are not known", "Use an X servo."
            )
        if mode != _POSITION_MODE:
            raise self._unfit(
                servo,
                f"is in {_MODES.get(mode, f'the unknown operating mode {mode}')} mode, not in "
                "position mode",
                f"Set its Operating Mode to 3 {_WIZARD_ADVICE}",
            )
        if drive & ~1:  # bit 0 only turns the direction round
            raise self._unfit(
                servo,
                f"has Drive Mode {drive}: a profile by time, or torque that goes on with a goal",
                f"Set its Drive Mode to 0 or 1 {_WIZARD_ADVICE}",
            )
        if startup:
            raise self._unfit(
                servo,
                "switches its torque on, or restores its memory, by itself after a reset",
                f"Set its Startup Configuration to 0 {_WIZARD_ADVICE}",
            )

    def _reboot(self, servos: Sequence[int]) -> None:
        for servo in servos:
            self._line.write(encode(Packet(servo, Instruction.REBOOT)))
        for _ in range(_REBOOT_WAITS):
            self._clock.sleep(_REBOOT_TIME)
            if self.ping(servos[-1]):
                break
        for servo, answer in self._read_all(servos, _HARDWARE_ERROR, 1).items():
            if answer[1]:
                raise self._unfit(
                    servo,
                    f"reports {_in_words(answer[1])}, also after a reboot, and has its torque off",
                    "Relieve it, let it cool for 20 minutes and check its supply.",
                )

    def _write(self, address: int, servos: Sequence[int], value: int, size: int) -> None:
        """Writes a number into several servos, which none of them acknowledges."""
        self._line.write(encode(sync_write(address, dict.fromkeys(servos, value), size)))

    def _read_all(self, servos: Sequence[int], address: int, size: int) -> dict[int, bytes]:
        """Reads ``size`` bytes of each servo from an address on; before them stands the error."""

        def question(missing: Sequence[int]) -> Packet:
            if len(missing) == 1:
                return read(missing[0], address, size)
            return sync_read(address, size, missing)

        answers = self._query(lambda missing: encode(question(missing)), servos, size)
        for servo, answer in answers.items():
            error = answer[0] & ~ALERT
            if error or len(answer) != 1 + size:
                kind = PacketError(error).name if error in list(PacketError) else f"error {error}"
                raise self._unfit(
                    servo,
                    f"does not tell its registers from {address} on: "
                    f"{kind.lower().replace('_', ' ')}",
                    "Check that its firmware is current.",
                )
        return answers


def _numbers(data: bytes, size: int) -> list[int]:
    """Numbers of ``size`` bytes, low first, one after another; a rest is left out."""
    starts = range(0, len(data) - size + 1, size)
    return [int.from_bytes(data[start : start + size], "little") for start in starts]


def _in_words(error: int) -> str:
    """A hardware error in words; empty for none."""
    words = [words for bit, words in _FAULTS.items() if error & bit]
    return " and ".join(words) or (f"the hardware error {error}" if error else "")


@dataclass(frozen=True, kw_only=True)
class DynamixelSettings(AnsweringServoSettings):
    """The serial line to the servos; their outputs are their IDs."""

    name = DynamixelChain.name
    outputs = range(1, 253)
    bauds = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)
    usual_baud = 57600
    chain = DynamixelChain
