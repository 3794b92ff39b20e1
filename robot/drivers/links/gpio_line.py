"""One output line of a GPIO chip, the seam to a pin of the computer.

Source: Linux' GPIO character device, uAPI version 2 (``linux/gpio.h``).
"""

from __future__ import annotations

import errno
import fcntl
import os
import struct
from typing import Final, Protocol

from robot.drivers.links.device_files import group_of, others_like
from robot.errors import DeviceMissingError

_GET_LINE: Final = 0xC250B407
_SET_VALUES: Final = 0xC010B40F
_OUTPUT: Final = 1 << 3
_OUTPUT_VALUES: Final = 2
_MOST_LINES: Final = 64
_MOST_ATTRIBUTES: Final = 10
# offsets, consumer, then the configuration: flags, number of attributes, padding, attributes (id,
# padding, value, mask); number of lines, size of the event buffer, padding, file descriptor.
_REQUEST: Final = struct.Struct(f"={_MOST_LINES}I 32s QI20x {'I4xQQ' * _MOST_ATTRIBUTES} II20x i")


class OutputLine(Protocol):
    """A line that is driven high or low."""

    def set(self, high: bool) -> None:
        """Drives it.

        Raises:
            DeviceError: It cannot be driven any more.
        """

    def close(self) -> None:
        """Gives it back; its level is then up to the kernel, and to what pulls it up or down."""


class GPIOLine:
    """A line of a chip such as ``/dev/gpiochip0``, driven from the moment that it is opened.

    Args:
        chip: The chip's device file.
        line: The line's number on it.
        high: Its first level.

    Raises:
        DeviceMissingError: There is no such chip or line, it is in use, or not ours to use.
    """

    def __init__(self, chip: str, line: int, high: bool):
        self._name = f"The GPIO line {line} of {chip}"
        request = bytearray(
            _REQUEST.pack(
                *(line, *(0,) * (_MOST_LINES - 1)),
                b"robotd",
                *(_OUTPUT, 1),
                *(_OUTPUT_VALUES, int(high), 1, *(0,) * 3 * (_MOST_ATTRIBUTES - 1)),
                *(1, 0, -1),
            )
        )
        try:
            device = os.open(chip, os.O_RDWR | os.O_CLOEXEC)
            try:
                fcntl.ioctl(device, _GET_LINE, request)
            finally:
                os.close(device)
        except OSError as error:
            raise DeviceMissingError(
                f"{self._name} cannot be opened: {error.strerror}.", _why_closed(chip, error)
            ) from error
        self._line: int = _REQUEST.unpack(request)[-1]

    def set(self, high: bool) -> None:
        """Drives it."""
        try:
            fcntl.ioctl(self._line, _SET_VALUES, struct.pack("=QQ", int(high), 1))
        except OSError as error:
            raise DeviceMissingError(
                f"{self._name} cannot be driven: {error.strerror}.",
                "If its chip is on an adapter, plug that in again.",
            ) from error

    def close(self) -> None:
        """Gives it back."""
        os.close(self._line)


def _why_closed(chip: str, error: OSError) -> str:
    match error.errno:
        case errno.ENOENT | errno.ENXIO | errno.ENODEV:
            found = ", ".join(others_like(chip))
            return f"There are {found}." if found else "There is no GPIO chip at all."
        case errno.EACCES | errno.EPERM:
            return f"Add the user to the group {group_of(chip, 'gpio')}, then log in again."
        case errno.EBUSY:
            return "Look with gpioinfo which program has it, and end that."
        case _:
            return "Look with gpioinfo whether it is a line of a GPIO chip."
