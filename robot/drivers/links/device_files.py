"""Device files: serial lines, and I/O ports through ``/dev/port``.

Sources: tty_ioctl(4); port(4).
"""

from __future__ import annotations

import errno
import fcntl
import grp
import os
import re
import termios
from contextlib import suppress
from pathlib import Path
from typing import Final, Protocol

import serial

from robot.errors import DeviceMissingError


def others_like(path: str) -> list[str]:
    """The device files beside a path whose names differ from its own in their number alone."""
    wanted = Path(path)
    stem = wanted.name.rstrip("0123456789")
    try:
        names = os.listdir(wanted.parent)
    except OSError:
        return []
    numbers = [
        int(name[len(stem) :]) for name in names if re.fullmatch(rf"{re.escape(stem)}\d+", name)
    ]
    return [str(wanted.with_name(f"{stem}{number}")) for number in sorted(numbers)]


def group_of(path: str, usual: str) -> str:
    """Name of the group that may use a device file; ``usual`` where that is root, or unknown."""
    try:
        name = grp.getgrgid(os.stat(path).st_gid).gr_name
    except (OSError, KeyError):
        return usual
    return usual if name == "root" else name


class PortIO(Protocol):
    """Bytes in and out of I/O ports."""

    def read(self, port: int, n: int = 1) -> bytes:
        """Reads ``n`` successive ports, lowest first."""

    def write(self, port: int, value: int) -> None:
        """Writes one byte, 0 to 255, to a port."""

    def close(self) -> None:
        """Gives the ports back."""


class ClosedPorts:
    """Ports that are not open: nothing can be read or written."""

    def read(self, port: int, n: int = 1) -> bytes:
        """Fails."""
        raise OSError(errno.EBADF, "they are not open")

    def write(self, port: int, value: int) -> None:
        """Fails."""
        raise OSError(errno.EBADF, "they are not open")

    def close(self) -> None:
        """Does nothing."""


class DevPort:
    """The ports of this machine through ``/dev/port``.

    Unbuffered on purpose: read-ahead would touch ports that nobody asked for.
    """

    def __init__(self, path: str = "/dev/port"):
        self._fd = os.open(path, os.O_RDWR | os.O_CLOEXEC)

    def read(self, port: int, n: int = 1) -> bytes:
        """Reads ``n`` successive ports, lowest first."""
        return os.pread(self._fd, n, port)

    def write(self, port: int, value: int) -> None:
        """Writes one byte to a port."""
        os.pwrite(self._fd, bytes((value,)), port)

    def close(self) -> None:
        """Closes the file."""
        os.close(self._fd)


def open_dev_port(
    base: int, length: int = 16, *, path: str = "/dev/port", claims: str = "/proc/ioports"
) -> DevPort:
    """Opens ``/dev/port`` unless a kernel driver has claimed the range.

    Args:
        base: First port that will be used.
        length: Number of ports.
        path: The device file.
        claims: The kernel's list of claimed ranges.

    Raises:
        DeviceMissingError: The ports are claimed or cannot be reached; the sentence says why.
    """
    owner = claimed_by(base, length, claims)
    if owner is not None:
        raise DeviceMissingError(
            f"The ports 0x{base:x}-0x{base + length - 1:x} belong to the kernel driver {owner}.",
            f"Unload it (modprobe -r {owner}), read the board through it (daq.driver = comedi), or "
            "correct the base address.",
        )
    try:
        return DevPort(path)
    except FileNotFoundError as error:
        raise DeviceMissingError(
            f"There is no {path}: this kernel gives no access to I/O ports.",
            "Use a PC kernel with CONFIG_DEVPORT.",
        ) from error
    except OSError as error:
        advice = "Run with CAP_SYS_RAWIO and with Secure Boot off, which locks the ports."
        if error.errno == errno.EACCES:  # the file's mode; a missing capability gives EPERM
            advice = "Install the udev rule that lets the daemon's user write to it."
        raise DeviceMissingError(f"{path} cannot be opened: {error.strerror}.", advice) from error


def claimed_by(base: int, length: int, claims: str = "/proc/ioports") -> str | None:
    """The name of the kernel driver that owns one of the ports, or ``None``.

    Bus windows, which contain everything, are no claims. The kernel shows a user without
    privileges only zeros, and then nothing is found; opening ``/dev/port`` will fail anyway.
    """
    try:
        lines = Path(claims).read_text(encoding="ascii").splitlines()
    except OSError:
        return None  # nothing known, nothing refused
    for line in lines:
        span, _, owner = line.partition(":")
        first, _, last = span.strip().partition("-")
        owner = owner.strip()
        overlaps = int(first, 16) < base + length and base <= int(last, 16)
        if overlaps and not owner.startswith("PCI "):
            return owner
    return None


_SERIAL_TIMEOUT: Final = (
    1.0  # s; pyserial counts a moment without the processor as the line's delay
)


class OwnLine(serial.Serial):
    """A serial line that the kernel opens for nobody else, root aside, until it is closed.

    A lock keeps out only those who ask for one: a login console or ``cat`` would take half of what
    a device answers. Who has the line open already keeps it; see ``readers``.
    """

    def open(self) -> None:
        """Opens the line, and keeps others from opening it."""
        super().open()
        try:
            fcntl.ioctl(self.fileno(), termios.TIOCEXCL)
        except OSError:
            super().close()
            raise

    def close(self) -> None:
        """Closes the line; others may open it again, even where one still has it open."""
        if self.is_open:
            with suppress(OSError):  # hung up
                fcntl.ioctl(self.fileno(), termios.TIOCNXCL)
        super().close()


def readers(port: str) -> str:
    """Advice on how to find and end other readers of a line: the end of a sentence."""
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
        return OwnLine(
            port, baud, timeout=_SERIAL_TIMEOUT, write_timeout=_SERIAL_TIMEOUT, exclusive=True
        )
    except (OSError, termios.error) as error:
        raise DeviceMissingError(
            f"The serial port {port} cannot be opened: {error}.", _why_no_serial_line(port, error)
        ) from error


def _why_no_serial_line(port: str, error: Exception) -> str:
    match getattr(error, "errno", None):
        case errno.ENOENT | errno.ENXIO | errno.ENODEV:
            others = ", ".join(others_like(port))
            return "Plug the adapter in, or name its link in /dev/serial/by-id" + (
                f"; there are {others}." if others else "."
            )
        case errno.EACCES | errno.EPERM:
            return f"Add the user to the group {group_of(port, 'dialout')}, then log in again."
        case errno.EAGAIN | errno.EBUSY:
            return f"End the other program that has it open (fuser -v {port})."
        case _:
            return "Name the device file of a serial port, such as /dev/ttyS0."
