"""Emulated GPIO chips, at their device files: uAPI version 2 of Linux' character device.

Source: ``linux/gpio.h``, and the kernel's documentation of the GPIO character device API. An input
reads what drives it from outside; where nothing does, the pull that was asked for, or low without
one. What drives it here does not bounce, so that debouncing changes nothing. Not modelled: events,
several lines in one request, open drains, chips without pulls.
"""

from __future__ import annotations

import errno
import os
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import ClassVar, Final

from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import Fault, FaultSwitch

CALL_TIME: Final = 2e-6  # s
LINES: Final = 54
"""Number of lines of a Raspberry Pi's chip."""

_USED: Final = 1 << 0
_ACTIVE_LOW: Final = 1 << 1
_INPUT: Final = 1 << 2
_OUTPUT: Final = 1 << 3
_PULL_UP: Final = 1 << 8
_PULLS: Final = (1 << 8, 1 << 9, 1 << 10)
_LEVELS: Final = 2  # kinds of attributes
_DEBOUNCE: Final = 3
_FIRST_DESCRIPTOR: Final = 1 << 20  # beyond this process's own


class _Requests(IntEnum):
    """What can be asked of a chip, and of a line."""

    CHIP_INFO = 0x8044B401
    LINE_INFO = 0xC100B405
    GET_LINE = 0xC250B407
    GET_VALUES = 0xC010B40E
    SET_VALUES = 0xC010B40F


@dataclass(frozen=True, kw_only=True)
class Chip:
    """A chip.

    Attributes:
        path: Device file of the chip.
        label: Label of the chip.
        names: Names of lines, by number.
        taken: Other programs that have a line, by number; it cannot be opened.
    """

    path: str = "/dev/gpiochip0"
    label: str = "pinctrl-bcm2835"
    names: Mapping[int, str] = field(default_factory=dict)
    taken: Mapping[int, str] = field(default_factory=dict)


@dataclass
class _Line:
    """A line that was opened."""

    chip: Chip
    offset: int
    consumer: str
    flags: int
    high: bool
    alive: bool = True


class GPIOEmulator(FaultSwitch):
    """The GPIO chips of one computer, to give to drivers in the place of its device files.

    Args:
        chips: Chips of the computer.
        level: Tells whether a line is driven high from outside, given its chip's path and its
            number; ``None`` where nothing drives it.
        clock: Is charged 2 µs per call.
        driven: Called with chip, number and level of an output whenever it is driven.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        "unplugged": Fault(
            "the chips' adapter is out of the host: what was open stays dead, and nothing can be "
            "opened"
        ),
        "short": Fault("the wire of line n touches ground", range(LINES)),
        "broken": Fault("the wire of line n has come off", range(LINES)),
    }

    def __init__(
        self,
        chips: Sequence[Chip],
        level: Callable[[str, int], bool | None],
        clock: Clock,
        *,
        driven: Callable[[str, int, bool], None] = lambda chip, line, high: None,
    ):
        super().__init__()
        self._chips = {chip.path: chip for chip in chips}
        self._level = level
        self._clock = clock
        self._driven = driven
        self._last_descriptor = _FIRST_DESCRIPTOR
        self._files: dict[int, Chip] = {}
        self._lines: dict[int, _Line] = {}

    @property
    def handles(self) -> int:
        """Number of open files of chips and lines."""
        return len(self._files) + len(self._lines)

    def inject(self, fault: str, value: int = 0, amount: float = 0.0) -> None:
        """Switches a fault on; may be called from any thread."""
        super().inject(fault, value, amount)
        if fault == "unplugged":
            for line in list(self._lines.values()):
                line.alive = False

    def chips(self) -> list[str]:
        """Paths of the chips that there are."""
        return [] if "unplugged" in self._faults else list(self._chips)

    def open(self, path: str) -> int:
        """Opens a chip."""
        if path not in self.chips():
            raise _error(errno.ENOENT)
        self._files[self._new_descriptor()] = self._chips[path]
        return self._last_descriptor

    def close(self, file: int) -> None:
        """Closes a chip, or a line, which is then free."""
        if self._files.pop(file, None) is None and self._lines.pop(file, None) is None:
            raise _error(errno.EBADF)

    def ioctl(self, file: int, request: int, argument: bytearray) -> None:
        """Makes a request of a chip or a line, which answers in place."""
        self._clock.charge(CALL_TIME)
        size = request >> 16 & 0x3FFF
        if len(argument) < size:
            raise _error(errno.EFAULT)
        if file in self._files:
            self._chip_request(self._files[file], request, argument)
        elif file in self._lines:
            self._line_request(self._lines[file], request, argument)
        else:
            raise _error(errno.EBADF)

    def _chip_request(self, chip: Chip, request: int, argument: bytearray) -> None:
        if "unplugged" in self._faults:
            raise _error(errno.ENODEV)
        match request:
            case _Requests.CHIP_INFO:
                name = os.path.basename(chip.path)
                struct.pack_into("=32s32sI", argument, 0, name.encode(), chip.label.encode(), LINES)
            case _Requests.LINE_INFO:
                self._describe(chip, argument)
            case _Requests.GET_LINE:
                self._open_line(chip, argument)
            case _:
                raise _error(errno.EINVAL)

    def _describe(self, chip: Chip, argument: bytearray) -> None:
        (offset,) = struct.unpack_from("=I", argument, 64)
        if offset >= LINES:
            raise _error(errno.EINVAL)
        line = self._holder(chip, offset)
        consumer = chip.taken.get(offset, line.consumer if line else "")
        flags = (line.flags if line else _INPUT) | (_USED if consumer else 0)
        argument[:] = bytes(len(argument))
        struct.pack_into(
            *("=32s32sIIQ", argument, 0),
            *(chip.names.get(offset, "").encode(), consumer.encode(), offset, 0, flags),
        )

    def _open_line(self, chip: Chip, argument: bytearray) -> None:
        offset, *_ = struct.unpack_from("=64I", argument, 0)
        (consumer,) = struct.unpack_from("=32s", argument, 256)
        flags, attributes = struct.unpack_from("=QI", argument, 288)
        (count,) = struct.unpack_from("=I", argument, 560)
        directions = flags & (_INPUT | _OUTPUT)
        pulls = [pull for pull in _PULLS if flags & pull]
        if count != 1 or offset >= LINES or attributes > 10 or not directions:
            raise _error(errno.EINVAL)
        if directions == _INPUT | _OUTPUT or len(pulls) > 1:
            raise _error(errno.EINVAL)
        if any(argument[300:320]) or any(argument[568:588]):  # padding
            raise _error(errno.EINVAL)
        high = False
        for index in range(attributes):
            kind, value, lines = struct.unpack_from("=I4xQQ", argument, 320 + 24 * index)
            if kind not in (_LEVELS, _DEBOUNCE) or (kind == _DEBOUNCE) != (directions == _INPUT):
                raise _error(errno.EINVAL)
            high = high or (kind == _LEVELS and bool(value & lines & 1))
        if offset in chip.taken or self._holder(chip, offset) is not None:
            raise _error(errno.EBUSY)
        name = consumer.split(b"\0", 1)[0].decode()
        line = _Line(chip, offset, name or "?", flags, high)
        self._lines[self._new_descriptor()] = line
        if flags & _OUTPUT:
            self._driven(chip.path, offset, high != bool(flags & _ACTIVE_LOW))
        struct.pack_into("=i", argument, 588, self._last_descriptor)

    def _line_request(self, line: _Line, request: int, argument: bytearray) -> None:
        if not line.alive:
            raise _error(errno.ENODEV)
        bits, mask = struct.unpack_from("=QQ", argument, 0)
        inverted = bool(line.flags & _ACTIVE_LOW)
        if mask != 1:
            raise _error(errno.EINVAL)
        if request == _Requests.GET_VALUES:
            high = line.high != inverted if line.flags & _OUTPUT else self._input_is_high(line)
            struct.pack_into("=QQ", argument, 0, int(high != inverted), mask)
        elif request == _Requests.SET_VALUES and line.flags & _OUTPUT:
            line.high = bool(bits & 1)
            self._driven(line.chip.path, line.offset, line.high != inverted)
        else:
            raise _error(errno.EPERM if request == _Requests.SET_VALUES else errno.EINVAL)

    def _input_is_high(self, line: _Line) -> bool:
        """Whether an input is high."""
        if self._faults.get("short") == line.offset:
            return False
        is_broken = self._faults.get("broken") == line.offset
        outside_level = None if is_broken else self._level(line.chip.path, line.offset)
        return bool(line.flags & _PULL_UP) if outside_level is None else outside_level

    def _holder(self, chip: Chip, offset: int) -> _Line | None:
        lines = (one for one in self._lines.values() if one.chip is chip and one.offset == offset)
        return next(lines, None)

    def _new_descriptor(self) -> int:
        self._last_descriptor += 1
        return self._last_descriptor


def _error(number: int) -> OSError:
    return OSError(number, os.strerror(number))
