"""How drivers reach their devices: the buses of a computer.

This is the seam to the outside. A simulated robot brings openers that lead to emulated devices, and
everything above them is the same code.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import serial

from robot.drivers.links.analogue_inputs import AnalogueInputs
from robot.drivers.links.device_files import PortIO, open_dev_port, open_serial
from robot.drivers.links.gpio import GPIODevices, LinuxGPIO
from robot.drivers.links.i2c import I2CBus, I2CLink, open_i2c
from robot.host.clock import Clock


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
