"""An emulated I²C bus: messages to whoever has their address, as the controller of a Pi sends them.

Source: the I²C specification (UM10204), and Linux' driver ``i2c-bcm2835``, which takes a transfer
with one read only, as its last message. Not modelled: clock stretching, several masters, transfers
cut off half-way.
"""

from __future__ import annotations

import ctypes
import errno
import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from functools import reduce
from operator import and_
from typing import ClassVar, Final

from smbus2 import i2c_msg

from robot.drivers.links.i2c import no_such_bus
from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import EVERY_NTH, Fault, FaultSwitch

TRANSFER_TIME: Final = 100e-6  # s; a few bytes at 400 kHz

_READ_FLAG: Final = 0x0001
_HUNG_BUS_TIME: Final = 0.1  # s until the kernel gives up


class I2CDevice(FaultSwitch, ABC):
    """Base class of an emulated device; alone, it is its own bus.

    Args:
        clock: Is charged 100 µs per transfer.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        "nak": Fault("the device acknowledges nothing; with n, not every n-th transfer", EVERY_NTH),
        "unheard": Fault("every n-th transfer is carried out, and its acknowledge lost", EVERY_NTH),
        "hang": Fault("the device holds the bus low until the kernel gives up"),
    }

    def __init__(self, clock: Clock):
        super().__init__()
        self._clock = clock
        self._bus = I2CBus([self], clock)
        self._transfers = 0
        self._called = 0  # the address of the message under way

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        """Carries out messages as one transfer; reads are filled in place."""
        self._bus.i2c_rdwr(*messages)

    def close(self) -> None:
        """Does nothing."""

    def begin(self) -> bool:
        """Called at the beginning of a transfer; returns whether the device takes part in it."""
        self._transfers += 1
        return not self._strikes("nak", self._transfers)

    def heard(self) -> bool:
        """Called at the end of a transfer; returns whether its acknowledges reached the host."""
        return not self._strikes("unheard", self._transfers)

    def hears(self, address: int) -> bool:
        """Called at the beginning of a message; returns whether the device takes part in it."""
        self._called = address
        return self.answers(address)

    @abstractmethod
    def answers(self, address: int) -> bool:
        """Whether an address is one of the device's."""

    @abstractmethod
    def receive(self, data: bytes) -> bool:
        """Takes the bytes of a write; returns whether the device acknowledged them."""

    @abstractmethod
    def send(self, count: int) -> bytes:
        """Gives the bytes of a read."""

    def stop(self) -> None:
        """Called at the end of a transfer."""


class I2CBus(FaultSwitch):
    """A bus with devices on it; used by itself, it is a handle that never dies.

    The devices keep their supply while the adapter is unplugged.

    Args:
        devices: Devices on the bus.
        clock: Is charged 100 µs per transfer.

    Attributes:
        handles: Handles that are open.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        "unplugged": Fault(
            "the bus's adapter is out of the host: what was open stays dead, and nothing can be "
            "opened"
        )
    }

    def __init__(self, devices: Iterable[I2CDevice], clock: Clock):
        super().__init__()
        self.handles: set[Handle] = set()
        self._devices = tuple(devices)
        self._clock = clock

    def open(self, path: str) -> Handle:
        """Opens the bus, whatever it is called.

        Raises:
            DeviceMissingError: The bus is unplugged.
        """
        if "unplugged" in self._faults:
            raise no_such_bus(path, _error(errno.ENOENT))
        handle = Handle(self)
        self.handles.add(handle)
        return handle

    def inject(self, fault: str, value: int = 0, amount: float = 0.0) -> None:
        """Switches a fault on; may be called from any thread."""
        super().inject(fault, value, amount)
        for handle in list(self.handles):
            handle.alive = False

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        """Carries out messages as one transfer; reads are filled in place."""
        if any(message.flags & _READ_FLAG for message in messages[:-1]):
            raise _error(errno.EOPNOTSUPP)
        if any("hang" in device.faults for device in self._devices):
            self._clock.charge(_HUNG_BUS_TIME)
            raise _error(errno.ETIMEDOUT)
        self._clock.charge(TRANSFER_TIME)
        addresses = {message.addr for message in messages}
        addressed = [device for device in self._devices if any(map(device.answers, addresses))]
        present = [device for device in addressed if device.begin()]
        try:
            for message in messages:
                self._carry_out(message, [one for one in present if one.hears(message.addr)])
        finally:
            for device in present:
                device.stop()
        if not all(device.heard() for device in present):
            raise _error(errno.EREMOTEIO)

    def close(self) -> None:
        """Does nothing."""

    def _carry_out(self, message: i2c_msg, devices: list[I2CDevice]) -> None:
        if not devices:
            raise _error(errno.EREMOTEIO)
        if message.flags & _READ_FLAG:
            columns = zip(*(device.send(message.len) for device in devices), strict=True)
            data = bytes(reduce(and_, column) for column in columns)  # each can pull a bit down
            ctypes.memmove(message.buf, data, len(data))
        elif True not in [device.receive(bytes(message)) for device in devices]:
            raise _error(errno.EREMOTEIO)


class Handle:
    """An open bus, to give to a driver in the place of ``smbus2.SMBus``.

    Attributes:
        alive: Whether the adapter has not been unplugged since.
    """

    def __init__(self, bus: I2CBus):
        self.alive = True
        self._bus = bus

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        """Carries out messages as one transfer; reads are filled in place."""
        if not self.alive:
            raise _error(errno.ENODEV)
        self._bus.i2c_rdwr(*messages)

    def close(self) -> None:
        """Closes the handle; a dead one must be closed, too."""
        self._bus.handles.remove(self)


def _error(number: int) -> OSError:
    return OSError(number, os.strerror(number))
