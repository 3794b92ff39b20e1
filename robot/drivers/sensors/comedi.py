"""Analogue inputs through Linux' comedi: any board for which the kernel has a driver.

Source: comedilib 0.11 (``comedilib.h``, manual pages of section 3). Samples are scaled here rather
than by ``comedi_to_phys``, which answers NaN at both ends of the range: like the DMM-32's own
driver, this one gives the end of the range, where the input may lie beyond.
"""

from __future__ import annotations

import ctypes
import errno
import math
from ctypes import POINTER, c_char_p, c_double, c_int, c_uint, c_void_p
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Final

from robot.drivers.buses import Buses
from robot.drivers.links.device_files import group_of
from robot.drivers.sensors.dmm32 import CHANNELS, RANGES
from robot.errors import DeviceError, DeviceMissingError, DeviceTimeoutError
from robot.toml_sections import Section

LIBRARY: Final = "libcomedi.so.0"
_ANALOGUE_INPUT: Final = 1  # COMEDI_SUBD_AI
_VOLT: Final = 0  # UNIT_volt
_GROUND: Final = 0  # AREF_GROUND
_FIRST_SUBDEVICE: Final = 0
_TIMEOUTS: Final = (errno.ETIME, errno.ETIMEDOUT)


class ComediRange(ctypes.Structure):
    """``comedi_range``: the ends of an input range, and their unit."""

    _fields_ = (("min", c_double), ("max", c_double), ("unit", c_uint))


# Without these a pointer would lose its upper half on a 64-bit machine.
_PROTOTYPES: Final = MappingProxyType(
    {
        "comedi_open": (c_void_p, (c_char_p,)),
        "comedi_close": (c_int, (c_void_p,)),
        "comedi_errno": (c_int, ()),
        "comedi_strerror": (c_char_p, (c_int,)),
        "comedi_find_subdevice_by_type": (c_int, (c_void_p, c_int, c_uint)),
        "comedi_get_n_channels": (c_int, (c_void_p, c_uint)),
        "comedi_get_maxdata": (c_uint, (c_void_p, c_uint, c_uint)),
        "comedi_get_n_ranges": (c_int, (c_void_p, c_uint, c_uint)),
        "comedi_get_range": (POINTER(ComediRange), (c_void_p, c_uint, c_uint, c_uint)),
        "comedi_data_read": (
            c_int,
            (c_void_p, c_uint, c_uint, c_uint, c_uint, POINTER(c_uint)),
        ),
    }
)


def load_library(name: str = LIBRARY) -> ctypes.CDLL:
    """Loads comedilib.

    Raises:
        DeviceMissingError: It is not installed.
    """
    try:
        return ctypes.CDLL(name)
    except OSError as error:
        raise DeviceMissingError(
            f"The library {name} cannot be loaded: {error}.", "Install it: apt install libcomedi0."
        ) from error


@dataclass(frozen=True, kw_only=True)
class ComediSettings:
    """The board's device file, and its input range."""

    name: ClassVar = "comedi board"
    dithers: ClassVar = True
    inputs: ClassVar = CHANNELS  # at most; the board says how many it has when it is probed
    device: str
    input_range: str

    @property
    def rails(self) -> tuple[float, float]:
        """The volts at the ends of the input range."""
        return RANGES[self.input_range].low, RANGES[self.input_range].high

    @classmethod
    def read(cls, table: Section) -> ComediSettings:
        """Reads the keys ``device`` and ``input_range``."""
        return cls(
            device=table.text("device", "/dev/comedi0"),
            input_range=table.choice("input_range", tuple(RANGES), "±5V"),
        )

    def open(self, buses: Buses) -> ComediInput:
        """Loads the library and returns the driver, whose ``probe`` opens the board."""
        del buses
        return ComediInput(self.device, range_=self.input_range)

    def __str__(self) -> str:
        return f"{self.device}, {self.input_range}"


class ComediInput:
    """The first analogue input subdevice of a board; call ``probe`` before the first scan.

    Args:
        device: The board's device file, such as ``/dev/comedi0``.
        range_: Input range of all channels, a key of ``dmm32.RANGES``; the board must offer exactly
            this one.
        library: Comedilib, with its functions as attributes; default: the installed one.

    Raises:
        DeviceMissingError: Comedilib is not installed.
    """

    def __init__(self, device: str, *, range_: str = "±5V", library: Any = None):
        self._name = device
        self._range_key = range_
        self._library = load_library() if library is None else library
        for name, (result, arguments) in _PROTOTYPES.items():
            function = getattr(self._library, name)
            function.restype, function.argtypes = result, arguments
        self._inputs = self._range = self._channels = 0
        self._top, self._low, self._span = 1, 0.0, 0.0
        self._device: int | None = None

    def probe(self) -> None:
        """Opens the board, anew if need be, and finds its inputs and the range.

        Raises:
            DeviceMissingError: The board cannot be opened, or has no such inputs or range; the
                sentence says why.
        """
        self.close()
        library = self._library
        device = self._device = library.comedi_open(self._name.encode()) or None
        if device is None:
            advice = "Attach it with comedi_config, or name the device file that it has."
            if library.comedi_errno() in (errno.EACCES, errno.EPERM):
                group = group_of(self._name, "iocard")
                advice = f"Add the user to the group {group}, then log in again."
            raise DeviceMissingError(
                f"The board {self._name} cannot be opened: {self._reason()}.", advice
            )
        inputs = library.comedi_find_subdevice_by_type(device, _ANALOGUE_INPUT, _FIRST_SUBDEVICE)
        if inputs < 0:
            raise DeviceMissingError(
                f"The board {self._name} has no analogue inputs.",
                "Name the data acquisition board's device file.",
            )
        self._inputs = inputs
        self._channels = library.comedi_get_n_channels(device, inputs)
        self._top = library.comedi_get_maxdata(device, inputs, 0)
        if self._channels < 1 or self._top < 1:
            raise DeviceMissingError(
                f"The board {self._name} does not describe its inputs: {self._reason()}.",
                "See what dmesg says of it.",
            )
        offered = self._ranges()
        limits = RANGES[self._range_key].low, RANGES[self._range_key].high
        if limits not in offered:
            choices = [name for name, span in RANGES.items() if (span.low, span.high) in offered]
            raise DeviceMissingError(
                f"The board {self._name} has no input range {self._range_key}; of the ranges known "
                f"here it offers {', '.join(choices) or 'none'}.",
                "Set input_range to one of them, or read the board by its registers (dmm32).",
            )
        self._range = offered.index(limits)
        self._low, self._span = limits[0], limits[1] - limits[0]

    def scan(self, low: int, high: int) -> list[float]:
        """Converts the channels ``low`` to ``high``, one after the other.

        Returns:
            Volts of each channel, in order.

        Raises:
            DeviceError: The board is gone, hangs, is not open, or has no such channels.
        """
        if self._device is None:  # comedilib would follow the null pointer
            raise DeviceMissingError(
                f"The board {self._name} is not open.", "Find out why it could not be opened."
            )
        if not 0 <= low <= high < self._channels:
            raise DeviceMissingError(
                f"The board {self._name} has channels 0 to {self._channels - 1}, not {low} to "
                f"{high}.",
                "Name only these in the configuration.",
            )
        return [self._convert(channel) for channel in range(low, high + 1)]

    def close(self) -> None:
        """Closes the device."""
        if self._device is not None:
            self._library.comedi_close(self._device)
            self._device = None

    def _ranges(self) -> list[tuple[float, float]]:
        """Ends of each range in volts, in the board's own order; NaN for another unit."""
        count = self._library.comedi_get_n_ranges(self._device, self._inputs, 0)
        ranges = []
        for number in range(count):
            entry = self._library.comedi_get_range(self._device, self._inputs, 0, number)
            if entry and entry.contents.unit == _VOLT:
                ranges.append((round(entry.contents.min, 6), round(entry.contents.max, 6)))
            else:
                ranges.append((math.nan, math.nan))
        return ranges

    def _convert(self, channel: int) -> float:
        sample = c_uint()
        converted = self._library.comedi_data_read(
            self._device, self._inputs, channel, self._range, _GROUND, ctypes.byref(sample)
        )
        if converted != 1:
            raise self._failed(channel)
        return self._low + sample.value / self._top * self._span

    def _failed(self, channel: int) -> DeviceError:
        is_late = self._library.comedi_errno() in _TIMEOUTS
        return (DeviceTimeoutError if is_late else DeviceMissingError)(
            f"The board {self._name} did not convert channel {channel}: {self._reason()}.",
            "Check that the board is seated, and what dmesg says of it.",
        )

    def _reason(self) -> str:
        text = self._library.comedi_strerror(self._library.comedi_errno())
        return text.decode(errors="replace") if text else "unknown reason"
