"""Access to a serial line, the seam below the drivers of serial devices."""

from __future__ import annotations

import errno
import fcntl
import os
import termios
from contextlib import suppress
from typing import Final

import serial

from robot.drivers.links.device_files import group_of, others_like
from robot.errors import DeviceMissingError

_TIMEOUT: Final = 1.0  # pyserial counts a moment without the processor as the line's delay


class OwnLine(serial.Serial):
    """A serial line that the kernel opens for nobody else, root aside, until it is closed.

    A lock keeps out only those who ask for one: a login console or ``cat`` would take half of what
    a device answers. Who has the line open already keeps it; see ``readers``.
    """

    def open(self) -> None:
        """Opens it."""
        super().open()
        try:
            fcntl.ioctl(self.fileno(), termios.TIOCEXCL)
        except OSError:
            super().close()
            raise

    def close(self) -> None:
        """Closes it; whoever else has it open must not be left with a line that is shut."""
        if self.is_open:
            with suppress(OSError):  # hung up
                fcntl.ioctl(self.fileno(), termios.TIOCNXCL)
        super().close()


def readers(port: str) -> str:
    """How to find who else reads a line, and to end it: the end of a sentence of advice."""
    terminal = os.path.basename(os.path.realpath(port))
    console = f"; systemctl stop serial-getty@{terminal}" if terminal.startswith("tty") else ""
    return f"that no other program reads the line (fuser -v {port}{console})."


def open_serial(port: str, baud: int) -> serial.Serial:
    """Opens a serial line (8N1), for this process alone.

    Args:
        port: Device file; prefer a link that survives re-plugging, as in ``/dev/serial/by-id``.
        baud: Bits per second.

    Raises:
        DeviceMissingError: The port cannot be opened; the sentence says why.
    """
    try:
        return OwnLine(port, baud, timeout=_TIMEOUT, write_timeout=_TIMEOUT, exclusive=True)
    except (OSError, termios.error) as error:
        raise DeviceMissingError(
            f"The serial port {port} cannot be opened: {error}.", _why_closed(port, error)
        ) from error


def _why_closed(port: str, error: Exception) -> str:
    match getattr(error, "errno", None):
        case errno.ENOENT | errno.ENXIO | errno.ENODEV:
            found = ", ".join(others_like(port))
            return "Plug the adapter in, or name its link in /dev/serial/by-id" + (
                f"; there are {found}." if found else "."
            )
        case errno.EACCES | errno.EPERM:
            return f"Add the user to the group {group_of(port, 'dialout')}, then log in again."
        case errno.EAGAIN | errno.EBUSY:
            return f"End the other program that has it open (fuser -v {port})."
        case _:
            return "Name the device file of a serial port, such as /dev/ttyS0."
