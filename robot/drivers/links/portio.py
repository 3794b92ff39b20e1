"""Access to the I/O ports of a PC, the seam below the data acquisition driver."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Protocol

from robot.errors import DeviceMissingError


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
