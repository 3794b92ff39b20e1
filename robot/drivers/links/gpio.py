"""Lines of GPIO chips: inputs with the kernel's pull-up and debounce, and outputs.

The kernel is asked directly, by uAPI version 2 of its GPIO character device (``linux/gpio.h``), in
Linux 5.10 and newer. So neither libgpiod nor its Python package is needed, which in Debian 12 is
older than version 2.
"""

from __future__ import annotations

import difflib
import errno
import fcntl
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from glob import glob
from typing import Final, Protocol

from robot.drivers.links.device_files import group_of
from robot.errors import DeviceMissingError
from robot.toml_sections import Section

DEFAULT_CHIP: Final = "/dev/gpiochip0"

_CHIP_INFO: Final = 0x8044B401
_LINE_INFO: Final = 0xC100B405
_GET_LINE: Final = 0xC250B407
_GET_VALUES: Final = 0xC010B40E
_SET_VALUES: Final = 0xC010B40F

_ACTIVE_LOW: Final = 1 << 1
_INPUT: Final = 1 << 2
_OUTPUT: Final = 1 << 3
_BIAS: Final = {"up": 1 << 8, "down": 1 << 9, "none": 1 << 10}

PULLS: Final = tuple(_BIAS)
"""What holds an input that nothing drives: the chip's resistor to supply or to ground, or none."""

_CHIP: Final = struct.Struct("=32s 32s I")  # name, label, number of lines
_LINE: Final = struct.Struct("=32s 32s I 188x")  # name, consumer, offset
# Offsets, consumer; flags, number of attributes, attributes; number of lines, file descriptor.
_REQUEST: Final = struct.Struct("=64I 32s Q I 20x 240s I 24x i")
_VALUES: Final = struct.Struct("=QQ")  # bits, and which of them count
_LEVEL: Final = struct.Struct("=I4xQQ")  # of an attribute: kind, levels, lines
_DEBOUNCE: Final = struct.Struct("=I4xI4xQ")  # of an attribute: kind, µs, lines
_LEVEL_KIND: Final = 2
_DEBOUNCE_KIND: Final = 3


class GPIODevices(Protocol):
    """The device files of GPIO chips; each method but ``chips`` may raise ``OSError``."""

    def chips(self) -> list[str]:
        """Paths of the chips that there are."""

    def open(self, path: str) -> int:
        """Opens a chip; returns a file descriptor."""

    def ioctl(self, file: int, request: int, argument: bytearray) -> None:
        """Makes a request of a chip or a line, which answers in place."""

    def close(self, file: int) -> None:
        """Closes a chip or a line."""


class LinuxGPIO:
    """The GPIO chips of this computer."""

    def chips(self) -> list[str]:
        """Paths of the chips that there are."""
        return sorted(glob("/dev/gpiochip*"), key=lambda path: (len(path), path))

    def open(self, path: str) -> int:
        """Opens a chip."""
        return os.open(path, os.O_RDWR | os.O_CLOEXEC)

    def ioctl(self, file: int, request: int, argument: bytearray) -> None:
        """Makes a request of a chip or a line, which answers in place."""
        fcntl.ioctl(file, request, argument)

    def close(self, file: int) -> None:
        """Closes a chip or a line."""
        os.close(file)


@dataclass(frozen=True)
class LinePlace:
    """Where a line is.

    Attributes:
        chip: The chip's device file, or its label, as ``gpiodetect`` shows it.
        line: The line's number on the chip, or its name there, as ``gpioinfo`` shows it.
    """

    chip: str
    line: int | str

    @classmethod
    def read(cls, table: Section, prefix: str = "") -> LinePlace:
        """Reads the keys ``chip`` and ``line``, whose names begin with the prefix.

        Raises:
            ConfigError: Names file, key and reason.
        """
        return cls(
            table.text(f"{prefix}chip", DEFAULT_CHIP),
            table.name_or_number(f"{prefix}line", 0, 511),
        )

    def __str__(self) -> str:
        return f"line {self.line} of {self.chip}"


class GPIOLine:
    """A line, ours from when it is opened until it is closed; see ``input_line``, ``output_line``.

    Methods raise ``DeviceMissingError`` where it can no longer be read or driven.

    Args:
        devices: GPIO chips.
        place: Where the line is.
        flags: Flags of the line, as in ``linux/gpio.h``.
        attribute: Packed attribute of the line; empty for none.

    Raises:
        DeviceMissingError: There is no such chip or line, it is in use, or the user may not use it.
    """

    def __init__(
        self, devices: GPIODevices, place: LinePlace, *, flags: int, attribute: bytes = b""
    ):
        self._devices = devices
        self._name = f"The GPIO {place}"
        path = _path_of(devices, place)
        with _opened(devices, path) as (chip, lines):
            offset = _offset_of(devices, chip, lines, place)
            request = bytearray(
                _REQUEST.pack(
                    *(offset, *(0,) * 63),
                    b"robotd",
                    *(flags, bool(attribute), attribute),
                    *(1, -1),
                )
            )
            try:
                devices.ioctl(chip, _GET_LINE, request)
            except OSError as error:
                raise _refused(devices, chip, offset, place, error) from error
        self._line: int = _REQUEST.unpack(request)[-1]

    def get(self) -> bool:
        """Whether the line is active."""
        values = bytearray(_VALUES.pack(0, 1))
        self._ask(_GET_VALUES, values, "read")
        return bool(_VALUES.unpack(values)[0] & 1)

    def set(self, high: bool) -> None:
        """Drives an output high or low."""
        self._ask(_SET_VALUES, bytearray(_VALUES.pack(high, 1)), "driven")

    def close(self) -> None:
        """Gives the line back; the kernel, and what pulls it up or down, then decide its level."""
        self._devices.close(self._line)

    def _ask(self, request: int, values: bytearray, what: str) -> None:
        try:
            self._devices.ioctl(self._line, request, values)
        except OSError as error:
            raise DeviceMissingError(
                f"{self._name} cannot be {what}: {error.strerror}.",
                "If its chip is on an adapter, plug that in again.",
            ) from error


def output_line(devices: GPIODevices, place: LinePlace, high: bool) -> GPIOLine:
    """Opens a line as an output, driven ``high`` or low from the moment that it is opened.

    Raises:
        DeviceMissingError: As ``GPIOLine``.
    """
    return GPIOLine(devices, place, flags=_OUTPUT, attribute=_LEVEL.pack(_LEVEL_KIND, high, 1))


def input_line(
    devices: GPIODevices, place: LinePlace, *, pull: str, active_low: bool, debounce: float
) -> GPIOLine:
    """Opens a line as an input.

    A chip that has no resistors ignores ``pull``, and the kernel does not say so.

    Args:
        devices: GPIO chips.
        place: Where the line is.
        pull: One of ``PULLS``.
        active_low: Whether a low level is active.
        debounce: How long a level must last to count, s; 0 for not at all.

    Raises:
        DeviceMissingError: As ``GPIOLine``.
    """
    return GPIOLine(
        devices,
        place,
        flags=_INPUT | _BIAS[pull] | (_ACTIVE_LOW if active_low else 0),
        attribute=_DEBOUNCE.pack(_DEBOUNCE_KIND, round(debounce * 1e6), 1) if debounce else b"",
    )


def _path_of(devices: GPIODevices, place: LinePlace) -> str:
    """The device file of a chip that may be given by its label."""
    if place.chip.startswith("/"):
        return place.chip
    labels = {path: label for path in devices.chips() for label in _labels(devices, path)}
    matches = [path for path, label in labels.items() if label == place.chip]
    if len(matches) == 1:
        return matches[0]
    chips = ", ".join(f"{path} ({label})" for path, label in labels.items())
    raise DeviceMissingError(
        f"{'No' if not matches else 'More than one'} GPIO chip is called {place.chip}.",
        f"Write one of {chips}." if chips else "There is no GPIO chip that this user may open.",
    )


def _labels(devices: GPIODevices, path: str) -> Iterator[str]:
    """Yields the label of a chip, if it can be read."""
    try:
        chip = devices.open(path)
        try:
            yield _described(devices, chip)[1]
        finally:
            devices.close(chip)
    except OSError:
        return


@contextmanager
def _opened(devices: GPIODevices, path: str) -> Iterator[tuple[int, int]]:
    """Opens a chip for a ``with`` block; gives its file descriptor and its number of lines."""
    chip = None
    try:
        chip = devices.open(path)
        _, _, lines = _described(devices, chip)
    except OSError as error:
        if chip is not None:
            devices.close(chip)
        raise DeviceMissingError(
            f"The GPIO chip {path} cannot be opened: {error.strerror}.",
            _why_no_chip(devices, path, error),
        ) from error
    try:
        yield chip, lines
    finally:
        devices.close(chip)


def _described(devices: GPIODevices, chip: int) -> tuple[str, str, int]:
    """Name, label and number of lines of a chip."""
    info = bytearray(_CHIP.size)
    devices.ioctl(chip, _CHIP_INFO, info)
    name, label, lines = _CHIP.unpack(info)
    return _text(name), _text(label), lines


def _why_no_chip(devices: GPIODevices, path: str, error: OSError) -> str:
    match error.errno:
        case errno.ENOENT | errno.ENXIO | errno.ENODEV:
            chips = ", ".join(devices.chips())
            return f"There are {chips}." if chips else "There is no GPIO chip at all."
        case errno.EACCES | errno.EPERM:
            return f"Add the user to the group {group_of(path, 'gpio')}, then log in again."
        case _:
            return "Name the device file of a GPIO chip, such as /dev/gpiochip0: see gpiodetect."


def _offset_of(devices: GPIODevices, chip: int, lines: int, place: LinePlace) -> int:
    """The number of a line that may be given by its name."""
    if isinstance(place.line, int):
        if place.line < lines:
            return place.line
        raise DeviceMissingError(
            f"There is no GPIO {place}.", f"That chip has the lines 0 to {lines - 1}."
        )
    names = [_line_info(devices, chip, offset)[0] for offset in range(lines)]
    if names.count(place.line) == 1:
        return names.index(place.line)
    if place.line in names:
        raise DeviceMissingError(
            f"There is more than one GPIO {place}.", "Give its number: see gpioinfo."
        )
    suggestions = " or ".join(difflib.get_close_matches(place.line, names, n=2))
    raise DeviceMissingError(
        f"There is no GPIO {place}.",
        f"Did you mean {suggestions}?" if suggestions else "gpioinfo shows which names it has.",
    )


def _refused(
    devices: GPIODevices, chip: int, offset: int, place: LinePlace, error: OSError
) -> DeviceMissingError:
    """The error for a line that cannot be opened."""
    match error.errno:
        case errno.EBUSY:
            try:
                _, consumer = _line_info(devices, chip, offset)
            except OSError:
                consumer = ""
            return DeviceMissingError(
                f"The GPIO {place} is in use by {consumer or 'another program'}.",
                "End that, or use another line: gpioinfo shows which are free.",
            )
        case errno.EACCES | errno.EPERM:
            advice = "Run as a user who may use GPIO lines."
        case _:
            advice = "It takes Linux 5.10 or newer; gpioinfo shows what the line can do."
    return DeviceMissingError(f"The GPIO {place} cannot be opened: {error.strerror}.", advice)


def _line_info(devices: GPIODevices, chip: int, offset: int) -> tuple[str, str]:
    """Name and consumer of a line; empty where it has none."""
    info = bytearray(_LINE.pack(b"", b"", offset))
    devices.ioctl(chip, _LINE_INFO, info)
    name, consumer, _ = _LINE.unpack(info)
    return _text(name), _text(consumer)


def _text(field: bytes) -> str:
    return field.split(b"\0", 1)[0].decode("utf-8", "replace")
