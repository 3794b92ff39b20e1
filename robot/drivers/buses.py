"""How drivers reach their devices: the buses of a computer.

This is the seam to the outside. A simulated robot brings openers that lead to emulated devices, and
everything above them is the same code. What a driver is told of its device, and so of its bus, are
its settings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Protocol

import serial

from robot.drivers.links.analogue_inputs import AnalogueInputs
from robot.drivers.links.device_files import PortIO, open_dev_port, open_serial
from robot.drivers.links.gpio import GPIODevices, LinuxGPIO
from robot.drivers.links.i2c import I2CBus, I2CLink, open_i2c
from robot.host.clock import Clock
from robot.toml_sections import Section


@dataclass(frozen=True, kw_only=True)
class Buses:
    """The buses of one computer; each opener raises ``DeviceMissingError``.

    Attributes:
        clock: The robot clock: paces a driver and measures its deadlines.
        open_serial: Opens a serial line, given its device file and baud rate.
        open_ports: Opens the I/O ports of a board, given its base address.
        open_i2c: Opens an I²C bus, given its device file.
        gpio: The GPIO chips.
        analogue: The inputs of the ``[daq]`` board, or ``None`` where there is none.
    """

    clock: Clock
    open_serial: Callable[[str, int], serial.Serial] = open_serial
    open_ports: Callable[[int], PortIO] = open_dev_port
    open_i2c: Callable[[str], I2CBus] = open_i2c
    gpio: GPIODevices = LinuxGPIO()
    analogue: AnalogueInputs | None = None

    def i2c(self, number: int) -> I2CLink:
        """An I²C bus by its number, not open yet."""
        return I2CLink(self.open_i2c, f"/dev/i2c-{number}")


class DriverSettings(Protocol):
    """The keys in ``robot.toml`` of one driver; the class that the registry names.

    A frozen dataclass: its ``repr`` is part of the configuration's hash. ``str`` says where the
    device is, for the log. It may have ``claims``, strings that name the places on a bus where no
    other device can be, such as ``0x29 on I²C bus 1``. Each kind has its own ``open``, which raises
    ``DeviceMissingError`` where the device cannot be opened; the sentence says why.

    Attributes:
        name: Name of the device, for messages, such as ``VL6180X``.
    """

    name: ClassVar[str]

    @classmethod
    def read(cls, table: Section) -> DriverSettings:
        """Reads the driver's own keys, without those that all drivers of the table share.

        Raises:
            ConfigError: Names file, key and reason.
        """
