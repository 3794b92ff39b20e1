"""Diamond Systems DMM-32-AT, 32X-AT and 32DX-AT: 32 analogue inputs of 16 bits on 16 I/O ports.

Only the analogue inputs are used, by polling: the board's clocks and interrupts stay off. A scan
converts a run of channels after one start and leaves the samples in the board's FIFO.

Source: Diamond Systems DMM-32DX-AT hardware manual (register map, range table, sequences); probe
as in Linux' comedi driver ``dmm32at``, which demands that both halves of the inputs are jumpered
single-ended. The FIFO is reset with bit 1 of register 7, as the manual's example value and that
driver do; the manual's prose says bit 2. Codes are signed in every range, also in unipolar ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Final

from robot.drivers.buses import Buses
from robot.drivers.links.device_files import ClosedPorts, PortIO
from robot.errors import CommandError, DeviceDataError, DeviceMissingError, DeviceTimeoutError
from robot.host.clock import Clock
from robot.toml_sections import Section

CHANNELS: Final = range(32)
BASES: Final = (0x100, 0x140, 0x180, 0x200, 0x280, 0x300, 0x340, 0x380)

# Registers, as offsets from the base address.
_DATA: Final = 0  # write: start a conversion; read: low byte, then high byte at offset 1
_LOW: Final = 2
_HIGH: Final = 3
_FIFO: Final = 7
_CONTROL: Final = 8
_INTERRUPTS: Final = 9
_RANGE: Final = 11

_FIFO_RESET: Final = 0x02
_SCAN_ENABLE: Final = 0x04
_RESET_ANALOGUE: Final = 0x20
_WAIT: Final = 0x80  # register 11: the input settles
_BUSY: Final = 0x80  # register 8: conversion or scan under way
_EMPTY: Final = 0x80  # register 7
_OVERFLOW: Final = 0x10  # register 7
_FLOATING: Final = 0xFF  # what a bus reads where no board answers

_CONVERSION_TIME: Final = 4e-6  # s
_GRACE: Final = 5e-3  # s beyond the nominal time of any wait
_MAX_POLLS: Final = 20_000  # ends a wait even if the clock stands still; a port access takes 1 µs
_SCAN_INTERVAL: Final = 20e-6  # between the channels: the longest, so that the input settles best
_SCAN_20_US: Final = 0x00

_PROBE: Final = (
    (_LOW, 0x00),
    (_HIGH, 0x1F),
    (_FIFO, _EMPTY),
    (_CONTROL, 0x60),  # all inputs single-ended
    (_INTERRUPTS, 0x00),
    (_RANGE, 0x0C),
)
_FLAGS: Final = MappingProxyType({_CONTROL: _BUSY, _RANGE: _WAIT})
_SETTLING: Final = "settling its input (WAIT)"
_CONVERTING: Final = "the conversion (STS)"


@dataclass(frozen=True)
class InputRange:
    """One input range: its code in register 11 and the volts at both ends."""

    code: int
    low: float
    high: float

    def volts(self, code: int) -> float:
        """The voltage that a signed 16-bit code stands for."""
        return self.low + (code + 32768) / 65536 * (self.high - self.low)


RANGES: Final = MappingProxyType(
    {
        "±10V": InputRange(0x8, -10.0, 10.0),
        "±5V": InputRange(0x0, -5.0, 5.0),
        "±2.5V": InputRange(0x1, -2.5, 2.5),
        "±1.25V": InputRange(0x2, -1.25, 1.25),
        "±0.625V": InputRange(0x3, -0.625, 0.625),
        "0..10V": InputRange(0xC, 0.0, 10.0),
        "0..5V": InputRange(0xD, 0.0, 5.0),
        "0..2.5V": InputRange(0xE, 0.0, 2.5),
        "0..1.25V": InputRange(0xF, 0.0, 1.25),
    }
)
"""Input ranges by name."""


@dataclass(frozen=True, kw_only=True)
class DMM32Settings:
    """Where the board is, and its input range."""

    name: ClassVar = "DMM-32"
    dithers: ClassVar = True
    inputs: ClassVar = CHANNELS
    base: int
    input_range: str

    @property
    def rails(self) -> tuple[float, float]:
        """The volts at the ends of the input range."""
        return RANGES[self.input_range].low, RANGES[self.input_range].high

    @classmethod
    def read(cls, table: Section) -> DMM32Settings:
        """Reads the keys ``base`` and ``input_range``."""
        return cls(
            base=table.one_of("base", BASES, 0x300, written="{:#x}"),
            input_range=table.choice("input_range", tuple(RANGES), "±5V"),
        )

    def open(self, buses: Buses) -> DMM32:
        """Driver of the board; its ``probe`` opens the ports."""
        return DMM32(buses.open_ports, base=self.base, clock=buses.clock, range_=self.input_range)

    def __str__(self) -> str:
        return f"0x{self.base:x}, {self.input_range}"


class DMM32:
    """One board; call ``probe`` before the first conversion.

    Args:
        open_ports: Opens the I/O ports from a base address on; the driver closes them.
        base: Base address as jumpered, one of ``BASES``; factory setting 0x300.
        clock: Measures deadlines.
        range_: Input range of all channels, a key of ``RANGES``.
    """

    def __init__(
        self,
        open_ports: Callable[[int], PortIO],
        *,
        base: int = 0x300,
        clock: Clock,
        range_: str = "±5V",
    ):
        self.range = RANGES[range_]
        self._open_ports = open_ports
        self._io: PortIO = ClosedPorts()
        self._base = base
        self._clock = clock
        self._range_code = _SCAN_20_US | self.range.code

    def open(self) -> None:
        """Opens the ports, anew if they are open.

        Raises:
            DeviceMissingError: They cannot be opened; the sentence says why.
        """
        self.close()
        self._io = self._open_ports(self._base)

    def probe(self) -> None:
        """Opens the ports, anew if need be, resets the analogue side, and identifies the board.

        Raises:
            DeviceMissingError: The ports cannot be opened; nothing, or something else, answers.
            DeviceTimeoutError: The board is there, and busy without end.
            DeviceDataError: The board's inputs are jumpered differential.
        """
        self.open()
        with self._ports():
            self._write(_CONTROL, _RESET_ANALOGUE)
            self._clock.sleep(1e-3)
            self._write(_FIFO, 0)
            self._write(_INTERRUPTS, 0)
            # Bits that the registers do not have must read back as zeros.
            self._write(_LOW, 0x80)
            self._write(_HIGH, 0xFF)
            self._write(_RANGE, 0x0C)
            self._clock.sleep(100e-6)
            registers = [self._read(offset) for offset, _ in _PROBE]
        expected = [value for _, value in _PROBE]
        if registers == expected:
            return
        if all(value == _FLOATING for value in registers):
            raise self._missing("everything there reads 0xFF")
        unflagged = [
            value & ~_FLAGS.get(offset, 0)
            for (offset, _), value in zip(_PROBE, registers, strict=True)
        ]
        if unflagged == expected:
            raise self._hangs(_SETTLING if registers[-1] & _WAIT else _CONVERTING, 1e-3)
        if [value | 0x60 for value in registers] == [value | 0x60 for value in expected]:
            raise DeviceDataError(
                f"The DMM-32 at 0x{self._base:x} has differential inputs.",
                "Set its jumper J5 to 32 single-ended inputs.",
            )
        read = " ".join(f"{value:02x}" for value in registers)
        wanted = " ".join(f"{value:02x}" for value in expected)
        raise self._missing(f"registers 2, 3, 7, 8, 9, 11 read {read} instead of {wanted}")

    def scan(self, low: int, high: int) -> list[float]:
        """Converts the channels ``low`` to ``high`` after one start.

        Returns:
            Volts of each channel, in order.

        Raises:
            CommandError: There are no such channels.
            DeviceError: The board is gone, hangs or lost a sample.
        """
        if not 0 <= low <= high < len(CHANNELS):
            raise CommandError(f"channels run upwards within 0 to 31, not {low} to {high}")
        count = high - low + 1
        with self._ports():
            # All settings every time: a board that lost power in between would have forgotten.
            self._write(_FIFO, _FIFO_RESET)
            self._write(_LOW, low)
            self._write(_HIGH, high)
            self._write(_RANGE, self._range_code)
            settled = self._await(_RANGE, _WAIT, 10e-6, _SETTLING)
            if settled & 0x0F != self.range.code:
                raise self._broken(f"range code 0x{self.range.code:x} reads 0x{settled & 0xF:x}")
            channel = self._read(_CONTROL) & 0x1F
            if channel != low:
                raise self._broken(f"channel {low} was selected and it stands at {channel}")
            duration = _CONVERSION_TIME
            if count > 1:
                self._write(_FIFO, _SCAN_ENABLE)
                duration = count * _SCAN_INTERVAL
            self._write(_DATA, 0)
            if count > 1:
                self._clock.sleep(duration)  # polling that long would cost more
            self._await(_CONTROL, _BUSY, duration, _CONVERTING)
            return self._samples(count)

    def close(self) -> None:
        """Gives the ports back."""
        ports, self._io = self._io, ClosedPorts()
        ports.close()

    def _samples(self, count: int) -> list[float]:
        base, read, volts = self._base + _DATA, self._io.read, self.range.volts
        data = [read(base, 2) for _ in range(count - 1)]
        flags_before = self._read(_FIFO)
        data.append(read(base, 2))
        flags_after = self._read(_FIFO)
        if flags_after == _FLOATING:
            raise self._missing("everything there reads 0xFF")
        if (flags_before | flags_after) & _OVERFLOW:
            raise self._broken("its FIFO overflowed")
        if flags_before & _EMPTY or not flags_after & _EMPTY:
            relation = "fewer" if flags_before & _EMPTY else "more"
            raise self._broken(f"its FIFO held {relation} samples than the {count} channels")
        return [volts(int.from_bytes(sample, "little", signed=True)) for sample in data]

    def _await(self, offset: int, flag: int, nominal: float, what: str) -> int:
        """Polls a register until a flag in it falls, or the deadline; returns its value."""
        deadline = self._clock.now() + nominal + _GRACE
        read, port, now = self._io.read, self._base + offset, self._clock.now
        value = _FLOATING
        for _ in range(_MAX_POLLS):
            is_late = now() > deadline  # before reading, so that a late look still counts
            value = read(port)[0]
            if not value & flag:
                return value
            if is_late:
                break
        if value == _FLOATING and self._read(_FIFO) == _FLOATING:
            raise self._missing("everything there reads 0xFF")
        raise self._hangs(what, nominal + _GRACE)

    def _read(self, offset: int) -> int:
        return self._io.read(self._base + offset)[0]

    def _write(self, offset: int, value: int) -> None:
        self._io.write(self._base + offset, value)

    @contextmanager
    def _ports(self) -> Iterator[None]:
        try:
            yield
        except (OSError, IndexError) as error:  # an empty read has no first byte
            raise DeviceMissingError(
                f"The I/O ports at 0x{self._base:x} failed: {error}.",
                "Check that the daemon may use /dev/port (CAP_SYS_RAWIO).",
            ) from error

    def _missing(self, how: str) -> DeviceMissingError:
        return DeviceMissingError(
            f"No DMM-32 answers at 0x{self._base:x}: {how}.",
            "Compare the base address with jumper J7, and check that the board is seated.",
        )

    def _hangs(self, what: str, seconds: float) -> DeviceTimeoutError:
        return DeviceTimeoutError(
            f"The DMM-32 at 0x{self._base:x} did not finish {what} within {seconds * 1e3:.1f} ms.",
            "Switch it off and on; if that does not help, replace it.",
        )

    def _broken(self, how: str) -> DeviceDataError:
        return DeviceDataError(
            f"The DMM-32 at 0x{self._base:x} is out of step: {how}.",
            "Check that no other program uses the board.",
        )
