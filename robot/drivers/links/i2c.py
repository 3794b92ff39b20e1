"""Access to an I²C bus, the seam below the drivers of the devices on it."""

from __future__ import annotations

import fcntl
from collections.abc import Iterable, Sequence
from typing import Protocol, cast

from smbus2 import I2cFunc, SMBus, i2c_msg

from robot.errors import DeviceMissingError, DeviceTimeoutError

_I2C_TIMEOUT = 0x0702  # ioctl of linux/i2c-dev.h; its unit is 10 ms


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
        DeviceMissingError: There is no such bus, it is not ours to use, or it cannot do combined
            transfers.
    """
    try:
        bus = SMBus(path)
        fcntl.ioctl(cast(int, bus.fd), _I2C_TIMEOUT, 10)
    except OSError as error:
        raise DeviceMissingError(
            f"The I²C bus {path} cannot be opened: {error.strerror}.",
            "Load i2c-dev (modprobe i2c-dev), and add the user to the group i2c.",
        ) from error
    if not bus.funcs & I2cFunc.I2C:
        bus.close()
        raise DeviceMissingError(
            f"The I²C bus {path} speaks only SMBus, as the ones on PC boards do.",
            "Use an adapter of which i2cdetect -F says that it does I2C.",
        )
    return bus


def keep_others_out(bus: I2CBus, name: str) -> None:
    """Locks a bus until it is closed: two programs must not drive the same servos.

    Sensors' drivers do not lock, so a process may open the bus for each of them. An emulated bus
    has no file and needs no lock.

    Raises:
        DeviceMissingError: Another program drives the servos on this bus.
    """
    file: int | None = getattr(bus, "fd", None)
    if file is None:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise DeviceMissingError(
            f"Another program drives the servos ({name}) on this I²C bus: {error.strerror}.",
            "End it first; if that is robotd: systemctl stop robotd",
        ) from error


class I2CRegisters:
    """The registers of one device on a bus.

    Args:
        bus: The bus; ``close`` closes it.
        address: The device's.
        name: What the device is called in sentences.
        wide: Whether a register's number has 16 bits, highest byte first, instead of 8.
    """

    def __init__(self, bus: I2CBus, address: int, name: str, *, wide: bool = False):
        self._bus = bus
        self._address = address
        self._name = name
        self._width = 2 if wide else 1

    def read(self, register: int, count: int = 1) -> bytes:
        """So many bytes from a register on.

        Raises:
            DeviceMissingError: Nobody acknowledges.
            DeviceTimeoutError: The bus hangs.
        """
        return self.write_and_read([], register, count)

    def write(self, register: int, *values: int) -> None:
        """Writes bytes from a register on; errors as those of ``read``."""
        self._transfer(self._message(register, *values))

    def write_and_read(
        self, writes: Iterable[Sequence[int]], register: int, count: int = 1
    ) -> bytes:
        """Some writes, each a register and its bytes, and a read, all in one transfer."""
        data = i2c_msg.read(self._address, count)
        messages = [self._message(*write) for write in writes]
        self._transfer(*messages, self._message(register), data)
        return bytes(data)

    def close(self) -> None:
        """Closes the bus."""
        self._bus.close()

    def _message(self, register: int, *values: int) -> i2c_msg:
        return i2c_msg.write(self._address, [*register.to_bytes(self._width, "big"), *values])

    def _transfer(self, *messages: i2c_msg) -> None:
        try:
            self._bus.i2c_rdwr(*messages)
        except TimeoutError as error:  # ETIMEDOUT: something holds the bus low
            raise DeviceTimeoutError(
                f"The I²C bus hangs at address 0x{self._address:x} ({self._name}): {error}.",
                "Check the bus's pull-ups and cable, then switch the device off and on.",
            ) from error
        except OSError as error:
            raise DeviceMissingError(
                f"Nothing acknowledges at I²C address 0x{self._address:x} ({self._name}): {error}.",
                "Check the device's power and cable, and the address in the configuration.",
            ) from error
