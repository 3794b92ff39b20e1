"""Access to an I²C bus, the seam below the distance sensor's driver."""

from __future__ import annotations

import fcntl
from typing import Protocol, cast

from smbus2 import I2cFunc, SMBus, i2c_msg

from robot.errors import DeviceMissingError

_I2C_TIMEOUT = 0x0702  # ioctl of linux/i2c-dev.h; its unit is 10 ms


class I2CBus(Protocol):
    """Combined transfers, as ``smbus2.SMBus`` offers them."""

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        """Carries out the messages as one transfer; reads are filled in place.

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
