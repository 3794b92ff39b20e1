"""Access to a serial line, the seam below the drivers of serial devices."""

from __future__ import annotations

import errno
import termios
from typing import Final

import serial

from robot.errors import DeviceMissingError

_TIMEOUT: Final = 1.0  # pyserial counts a moment without the processor as the line's delay


def open_serial(port: str, baud: int) -> serial.Serial:
    """Opens a serial line (8N1), for this process alone.

    Args:
        port: Device file; prefer a link that survives re-plugging, as in ``/dev/serial/by-id``.
        baud: Bits per second.

    Raises:
        DeviceMissingError: The port cannot be opened; the sentence says why.
    """
    try:
        return serial.Serial(port, baud, timeout=_TIMEOUT, write_timeout=_TIMEOUT, exclusive=True)
    except (OSError, termios.error) as error:
        raise DeviceMissingError(
            f"The serial port {port} cannot be opened: {error}.", _why_closed(error)
        ) from error


def _why_closed(error: Exception) -> str:
    match getattr(error, "errno", None):
        case errno.ENOENT | errno.ENXIO | errno.ENODEV:
            return "Plug the adapter in, or name its link in /dev/serial/by-id."
        case errno.EACCES | errno.EPERM:
            return "Add the user to the group dialout, then log in again."
        case errno.EAGAIN | errno.EBUSY:
            return "End the other program that has it open."
        case _:
            return "Name the device file of a serial port, such as /dev/ttyS0."
