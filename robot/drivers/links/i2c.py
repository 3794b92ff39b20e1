"""Access to an I²C bus, the seam below the drivers of the devices on it.

Where motors run, an acknowledge is lost now and then. A transfer that may be made twice is made up
to three times, here for all devices, and its repeats are counted; one that may not is made again
only where the device says that it did nothing.

Source: Linux' ``Documentation/i2c/fault-codes.rst`` for the errors of a transfer.
"""

from __future__ import annotations

import errno
import fcntl
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, Protocol, cast

from smbus2 import I2cFunc, SMBus, i2c_msg

from robot.drivers.links.device_files import group_of, others_like
from robot.errors import DeviceMissingError, DeviceTimeoutError

ATTEMPTS: Final = 3
"""Number of times that a transfer is made while nobody acknowledges it."""

_I2C_TIMEOUT: Final = 0x0702  # ioctl of linux/i2c-dev.h; its unit is 10 ms
_NAMES: Final = Path("/sys/class/i2c-dev")
_GONE: Final = frozenset({errno.ENODEV, errno.ESHUTDOWN, errno.EBADF})


class I2CBus(Protocol):
    """Combined transfers, as ``smbus2.SMBus`` offers them."""

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        """Carries out the messages as one transfer; reads are filled in place.

        The controller of a Raspberry Pi takes one read in a transfer, as its last message.

        Raises:
            OSError: Nobody acknowledged, or the bus hangs.
        """

    def close(self) -> None:
        """Closes the bus."""


def open_i2c(path: str) -> SMBus:
    """Opens a bus such as ``/dev/i2c-1``; a transfer hangs for at most about 100 ms.

    Raises:
        DeviceMissingError: There is no such bus, the user may not use it, or it cannot do combined
            transfers.
    """
    bus = SMBus()
    try:
        bus.open(path)
        fcntl.ioctl(cast(int, bus.fd), _I2C_TIMEOUT, 10)
    except OSError as error:
        bus.close()
        raise no_such_bus(path, error) from error
    if not bus.funcs & I2cFunc.I2C:
        bus.close()
        raise DeviceMissingError(
            f"The I²C bus {path} speaks only SMBus, as the ones on PC boards do.",
            "Use an adapter of which i2cdetect -F says that it does I2C.",
        )
    return bus


def no_such_bus(path: str, error: OSError) -> DeviceMissingError:
    """The error that says why a bus cannot be opened, and what to do about it."""
    match error.errno:
        case errno.ENOENT | errno.ENXIO | errno.ENODEV:
            buses = ", ".join(map(_described, others_like(path)))
            advice = (
                (
                    f"There are {buses}: name the right one as bus, or "
                    if buses
                    else "There is none: "
                )
                + "switch it on (on a Raspberry Pi: sudo raspi-config nonint do_i2c 0), load its "
                "driver (sudo modprobe i2c-dev), or plug its adapter in."
            )
        case errno.EACCES | errno.EPERM:
            advice = (
                f"Add the user to the group {group_of(path, 'i2c')} (sudo usermod -aG), then log "
                "in again."
            )
        case _:
            advice = "Name the device file of an I²C bus, such as /dev/i2c-1."
    return DeviceMissingError(f"The I²C bus {path} cannot be opened: {error.strerror}.", advice)


def _described(path: str) -> str:
    """Path of a bus with its adapter's name, which tells a Pi's pins from its displays."""
    try:
        name = (_NAMES / Path(path).name / "name").read_text(encoding="ascii").strip()
    except (OSError, ValueError):
        return path
    return f"{path} ({name})"


class I2CLink:
    """One I²C bus by its device file; not open yet.

    Args:
        open_bus: Opens a bus, given its device file.
        path: Device file of the bus.

    Attributes:
        transfers: Number of transfers so far, without repeats.
        repeats: Number of times that a transfer was made again, because nobody acknowledged.
    """

    def __init__(self, open_bus: Callable[[str], I2CBus], path: str):
        self.transfers = 0
        self.repeats = 0
        self._open_bus = open_bus
        self._path = path
        self._bus: I2CBus | None = None

    def open(self) -> None:
        """Opens the bus; anew if it is open: an adapter that was plugged in again is another.

        Raises:
            DeviceMissingError: The bus cannot be opened.
        """
        self.close()
        self._bus = self._open_bus(self._path)

    def close(self) -> None:
        """Closes the bus, if it is open."""
        bus, self._bus = self._bus, None
        if bus is not None:
            with suppress(OSError):  # the adapter may be gone, and with it the file
                bus.close()

    def keep_others_out(self, name: str) -> None:
        """Locks the bus until it is closed: two programs must not drive the same servos.

        Sensors' drivers do not lock, so a process may open the bus for each of them. An emulated
        bus has no file and needs no lock.

        Raises:
            DeviceMissingError: Another program drives the servos on this bus.
        """
        file: int | None = getattr(self._bus, "fd", None)
        if file is None:
            return
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise DeviceMissingError(
                f"Another program drives the servos ({name}) on this I²C bus: {error.strerror}.",
                "End it first; if that is robotd: systemctl stop robotd",
            ) from error

    def transfer(self, messages: Sequence[i2c_msg], device: str, done: Callable[[], bool]) -> None:
        """Carries out messages as one transfer, up to ``ATTEMPTS`` times.

        Args:
            messages: Messages of the transfer.
            device: Name of the device, for messages to people.
            done: Tells whether the device did, after all, what it did not acknowledge.

        Raises:
            DeviceMissingError: Nobody acknowledges, or there is no bus any more.
            DeviceTimeoutError: The bus hangs.
        """
        self.transfers += 1
        for attempt in range(1, ATTEMPTS + 1):
            try:
                if self._bus is None:
                    raise OSError(errno.ENODEV, "it is not open")
                self._bus.i2c_rdwr(*messages)
                return
            except TimeoutError as error:  # ETIMEDOUT: something holds the bus low
                raise DeviceTimeoutError(
                    f"The I²C bus hangs at {device}: {error}.",
                    "Check the bus's pull-ups and cable, then switch the device off and on.",
                ) from error
            except OSError as error:
                if error.errno in _GONE:
                    self.close()  # who keeps it open keeps the next adapter from its number
                    raise DeviceMissingError(
                        f"The adapter of the I²C bus {self._path} is gone, and with it {device}: "
                        f"{error}.",
                        "Plug it in again.",
                    ) from error
                if attempt == ATTEMPTS:
                    raise DeviceMissingError(
                        f"Nothing acknowledges at {device}: {error}.",
                        "Check the device's power and cable, and whether the address in the "
                        f"configuration answers: i2cdetect -y {self._path.rpartition('-')[2]}",
                    ) from error
            if done():
                return
            self.repeats += 1


class I2CRegisters:
    """The registers of one device on a bus.

    Args:
        link: The bus, which its owner opens and closes.
        address: Address of the device.
        name: Name of the device, for messages.
        wide: Whether a register's number has 16 bits, highest byte first, instead of 8.
    """

    def __init__(self, link: I2CLink, address: int, name: str, *, wide: bool = False):
        self._link = link
        self._address = address
        self._device = f"I²C address 0x{address:x} ({name})"
        self._width = 2 if wide else 1

    def read(self, register: int, count: int = 1) -> bytes:
        """Reads ``count`` bytes from a register on; reading must not change them.

        Raises:
            DeviceMissingError: Nobody acknowledges, or the adapter is gone.
            DeviceTimeoutError: The bus hangs.
        """
        return self.write_and_read([], register, count)

    def write(self, register: int, *values: int, done: Callable[[], bool] = lambda: False) -> None:
        """Writes bytes from a register on; errors as those of ``read``.

        Args:
            register: First register.
            values: Bytes to write.
            done: For a write that must not be made twice, such as the start of a measurement: tells
                whether the device took it although its acknowledge was lost.
        """
        self._link.transfer([self._message(register, *values)], self._device, done)

    def write_and_read(
        self, writes: Iterable[Sequence[int]], register: int, count: int = 1
    ) -> bytes:
        """Makes writes, each a register and its bytes, and then a read, all in one transfer."""
        data = i2c_msg.read(self._address, count)
        messages = [self._message(*write) for write in writes]
        messages += [self._message(register), data]
        self._link.transfer(messages, self._device, lambda: False)
        return bytes(data)

    def _message(self, register: int, *values: int) -> i2c_msg:
        return i2c_msg.write(self._address, [*register.to_bytes(self._width, "big"), *values])
