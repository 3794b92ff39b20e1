"""Emulated devices behind a serial adapter: a pseudo-terminal, and a thread that reads it."""

from __future__ import annotations

import fcntl
import glob
import os
import select
import shutil
import sys
import tempfile
import termios
import threading
import tty
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import ClassVar, Final, Protocol

from sim_robot.electronics.fault_switch import EVERY_NTH, Fault, FaultSwitch

_CHUNK: Final = 4096  # bytes read at a time
_SYNCHRONISE_TIMEOUT: Final = 2.0  # s of real time for a device to read what was written
_PREFIX: Final = "emulated-serial-"
_LINK: Final = "port"
_TCGETS2: Final = 0x802C542A  # ioctl of struct termios2, asm-generic/ioctls.h
_OUTPUT_SPEED: Final = 40  # offset in it of the baud rate, which need not be a usual one


class SerialDevice(FaultSwitch, ABC):
    """Base class of an emulated device on a serial line, whose ``port`` pyserial can open.

    The line can be unplugged and plugged in again, as a USB adapter can: the name is a link that
    vanishes and comes back, while the terminal behind it may be another one. The device has its own
    supply and does not notice.

    Attributes:
        port: Name of the serial port.
        bytes_read: Number of bytes acted upon, or swallowed by a cable that was pulled.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        "unplugged": Fault("the serial cable is out of the host, and the port is gone"),
        "drop": Fault("every n-th byte from the host is lost", EVERY_NTH),
        "corrupt": Fault("every n-th byte from the host arrives with bit 0 flipped", EVERY_NTH),
    }

    def __init__(self) -> None:
        super().__init__()
        _sweep()
        self._folder = tempfile.mkdtemp(prefix=_PREFIX)
        self._lock: int | None = os.open(self._folder, os.O_RDONLY)
        fcntl.flock(self._lock, fcntl.LOCK_EX)  # as long as we live: see _sweep
        self.port = os.path.join(self._folder, _LINK)
        self.bytes_read = 0
        self._changed = threading.Condition()
        self._link: _Link | None = None
        self._bytes_seen = 0
        self.replug()

    @property
    def host_baud(self) -> int:
        """The baud rate at which the host last set the port; 0 while it is unplugged."""
        link = self._link
        return 0 if link is None else link.baud

    @abstractmethod
    def receive(self, data: bytes) -> bytes:
        """Acts on bytes from the host, by the thread that reads the line; returns the answer."""

    def wait_until_read(self, count: int, timeout: float) -> bool:
        """Waits until ``bytes_read`` has reached ``count``.

        Args:
            count: Number of bytes written by the driver.
            timeout: Longest wait, s of real time.

        Returns:
            Whether they were all consumed; at once ``True`` while unplugged, for then there is
            nothing to wait for.
        """
        if self.bytes_read >= count:
            return True
        with self._changed:
            return self._changed.wait_for(
                lambda: self.bytes_read >= count or self._link is None, timeout
            )

    def inject(self, fault: str, value: int = 0, amount: float = 0.0) -> None:
        """Switches a fault on, or makes an event happen; may be called from any thread."""
        super().inject(fault, value, amount)
        if fault == "unplugged":
            self.unplug()

    def mend(self, fault: str | None = None) -> None:
        """Switches a fault off, or all of them; the cable comes back."""
        super().mend(fault)
        if fault in (None, "unplugged"):
            self.replug()

    def unplug(self) -> None:
        """Pulls the serial cable out of the host."""
        with self._changed:
            link, self._link = self._link, None
            self._changed.notify_all()
        if link is not None:
            self.bytes_read += link.close()
            os.unlink(self.port)

    def replug(self) -> None:
        """Plugs the cable in again."""
        if self._link is None:
            self._link = _Link(self._consume)
            os.symlink(self._link.name, self.port)

    def close(self) -> None:
        """Ends the thread and removes the port."""
        self.unplug()
        if self._lock is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
            os.close(self._lock)
            self._lock = None

    def _consume(self, data: bytes) -> bytes:
        received = len(data)
        if self._faults:
            data = self._damage(data)
        with self._changed:
            reply = self.receive(data)
            self.bytes_read += received
            self._changed.notify_all()
        return reply

    def _damage(self, data: bytes) -> bytes:
        arrived = bytearray()
        for byte in data:
            self._bytes_seen += 1
            if not self._strikes("drop", self._bytes_seen):
                arrived.append(byte ^ self._strikes("corrupt", self._bytes_seen))
        return bytes(arrived)


class Writes(Protocol):
    """A driver that counts what it has written."""

    @property
    def bytes_written(self) -> int:
        """Bytes handed to the port so far."""


class Follower:
    """Waits, when called, until an emulated device has read all that its driver wrote.

    Args:
        device: The emulated device.
        driver: Driver of the device.
    """

    def __init__(self, device: SerialDevice, driver: Writes):
        self._device = device
        self._driver = driver
        self._lost_bytes = 0

    def __call__(self) -> None:
        """Waits; bytes that never came are waited for only once."""
        written = self._driver.bytes_written
        self._device.wait_until_read(written - self._lost_bytes, _SYNCHRONISE_TIMEOUT)
        self._lost_bytes = written - self._device.bytes_read  # or late: a computer may stand still


def _sweep() -> None:
    """Removes the ports of emulators that were killed: nobody locks their folders any more."""
    for folder in glob.glob(os.path.join(tempfile.gettempdir(), f"{_PREFIX}*")):
        with suppress(OSError):  # somebody else's, or alive
            lock = os.open(folder, os.O_RDONLY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.path.islink(os.path.join(folder, _LINK)):  # else it is just being made
                    shutil.rmtree(folder)
            finally:
                os.close(lock)


class _Link:
    """One pty and the thread that reads it; asleep in ``poll`` while the line is silent."""

    def __init__(self, consume: Callable[[bytes], bytes]):
        self._consume = consume
        # The slave stays open here: after its last close the master would only read errors.
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(self._slave)
        self._wake_read, self._wake_write = os.pipe()
        self._thread = threading.Thread(target=self._run, name="emulated-serial", daemon=True)
        self._thread.start()

    @property
    def baud(self) -> int:
        """Baud rate at which the host set the line."""
        settings = fcntl.ioctl(self._slave, _TCGETS2, bytes(_OUTPUT_SPEED + 4))
        return int.from_bytes(settings[_OUTPUT_SPEED:], sys.byteorder)

    def close(self) -> int:
        """Ends the thread; returns how many bytes were still on their way."""
        os.write(self._wake_write, b"x")
        self._thread.join()
        swallowed = 0
        with suppress(BlockingIOError):
            while data := os.read(self._master, _CHUNK):
                swallowed += len(data)
        for fd in (self._master, self._slave, self._wake_read, self._wake_write):
            os.close(fd)
        return swallowed

    def _run(self) -> None:
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        poll.register(self._wake_read, select.POLLIN)
        while True:
            ready = poll.poll()
            if any(fd == self._wake_read for fd, _ in ready):
                return
            # Held open here, the line would stay exclusive after a daemon that was killed.
            fcntl.ioctl(self._slave, termios.TIOCNXCL)
            with suppress(BlockingIOError):
                reply = self._consume(os.read(self._master, _CHUNK))
                if reply:
                    os.write(self._master, reply)  # a full line loses bytes, as a real one does
