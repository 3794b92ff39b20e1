"""Device files: serial lines, I/O ports through ``/dev/port``, output lines of GPIO chips.

Sources: tty_ioctl(4); port(4); Linux' GPIO character device, uAPI version 2 (``linux/gpio.h``).
"""

from __future__ import annotations

import errno
import fcntl
import grp
import os
import re
import struct
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
    """The group that may use a device file; ``usual`` where that is root's, or nobody knows."""
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
                f"{self._name} cannot be opened: {error.strerror}.", _why_no_gpio_line(chip, error)
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


def _why_no_gpio_line(chip: str, error: OSError) -> str:
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


_SERIAL_TIMEOUT: Final = (
    1.0  # s; pyserial counts a moment without the processor as the line's delay
)


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
