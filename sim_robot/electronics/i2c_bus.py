"""An emulated I²C bus: messages to whoever has their address, as the controller of a Pi sends them.

Source: the I²C specification (UM10204), and Linux' driver ``i2c-bcm2835``, which takes a transfer
with one read only, as its last message.
"""

from __future__ import annotations

import ctypes
import errno
import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from functools import reduce
from operator import and_
from types import MappingProxyType
from typing import ClassVar, Final

from smbus2 import i2c_msg

from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import EVERY_NTH, FaultSwitch

TRANSFER_TIME: Final = 100e-6

_READ_FLAG: Final = 0x0001
_HUNG_BUS_TIME: Final = 0.1


class I2CDevice(FaultSwitch, ABC):
    """Base of an emulated device; alone, it is its own bus.

    Args:
        clock: Is charged 100 µs per transfer.
    """

    FAULTS: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "nak": "the device acknowledges nothing; with n, not every n-th transfer",
            "hang": "the device holds the bus low until the kernel gives up",
        }
    )
    NUMBERS: ClassVar[Mapping[str, range]] = MappingProxyType({"nak": EVERY_NTH})

    def __init__(self, clock: Clock):
        super().__init__()
        self._clock = clock
        self._bus = I2CBus([self], clock)
        self._begun = 0
        self._called = 0  # the address of the message under way

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        """Carries out messages as one transfer; reads are filled in place."""
        self._bus.i2c_rdwr(*messages)

    def close(self) -> None:
        """Does nothing."""

    def begin(self) -> bool:
        """Called at the beginning of a transfer; whether the device takes part in it."""
        self._begun += 1
        number = self._faults.get("nak")
        return number is None or (number > 0 and self._begun % number != 0)

    def hears(self, address: int) -> bool:
        """Called at the beginning of a message; whether the device takes part in it."""
        self._called = address
        return self.answers(address)

    @abstractmethod
    def answers(self, address: int) -> bool:
        """Whether an address is one of the device's."""

    @abstractmethod
    def receive(self, data: bytes) -> bool:
        """Takes the bytes of a write; whether it acknowledged them."""

    @abstractmethod
    def send(self, count: int) -> bytes:
        """Gives the bytes of a read."""

    def stop(self) -> None:
        """Called at the end of a transfer."""


class I2CBus:
    """A bus with devices on it, to give to a driver in the place of ``smbus2.SMBus``.

    Args:
        devices: What is on it.
        clock: Is charged 100 µs per transfer.
    """

    def __init__(self, devices: Iterable[I2CDevice], clock: Clock):
        self._devices = tuple(devices)
        self._clock = clock

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        """Carries out messages as one transfer; reads are filled in place."""
        if any(message.flags & _READ_FLAG for message in messages[:-1]):
            raise _error(errno.EOPNOTSUPP)
        if any("hang" in device.faults for device in self._devices):
            self._clock.charge(_HUNG_BUS_TIME)
            raise _error(errno.ETIMEDOUT)
        self._clock.charge(TRANSFER_TIME)
        addresses = {message.addr for message in messages}
        called = [one for one in self._devices if any(map(one.answers, addresses))]
        present = [device for device in called if device.begin()]
        try:
            for message in messages:
                self._carry_out(message, [one for one in present if one.hears(message.addr)])
        finally:
            for device in present:
                device.stop()

    def close(self) -> None:
        """Does nothing."""

    def _carry_out(self, message: i2c_msg, devices: list[I2CDevice]) -> None:
        if not devices:
            raise _error(errno.EREMOTEIO)
        if message.flags & _READ_FLAG:
            answers = zip(*(device.send(message.len) for device in devices), strict=True)
            data = bytes(reduce(and_, column) for column in answers)  # each can pull a bit down
            ctypes.memmove(message.buf, data, len(data))
        elif True not in [device.receive(bytes(message)) for device in devices]:
            raise _error(errno.EREMOTEIO)


def _error(number: int) -> OSError:
    return OSError(number, os.strerror(number))
