"""Drivers of the robot's electronics.

=================  ===============================================================================
``servo_bus``      What the choreography needs of a servo board, whatever its driver
``sv203``          Pontech SV203 servo board (plain, B, C) on a serial line: ``open_serial``,
                   ``SV203``
``dmm32``          Diamond Systems DMM-32-AT, 32X-AT and 32DX-AT analogue inputs: ``DMM32``
``portio``         The I/O ports below it: ``PortIO``, ``DevPort``, ``open_dev_port``
``vl6180x``        ST VL6180X distance sensor: ``VL6180X``
``i2c``            The bus below it: ``I2CBus``, ``open_i2c``
``comedi``         Analogue inputs through Linux' comedi, in the DMM-32's place: ``ComediInput``
=================  ===============================================================================

Rules that all of them keep: they are given an opened link and a clock, and start no threads; they
check ranges themselves, because the boards ignore bad input silently; every wait has a deadline;
whatever goes wrong on the link comes out as a ``DeviceError`` with a sentence on what to check.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

ANALOGUE_DRIVERS: Final = MappingProxyType(
    {
        "dmm32": ("robot.drivers.dmm32", "DMM32"),
        "comedi": ("robot.drivers.comedi", "ComediInput"),
    }
)
"""Name in the configuration → module and class, loaded only when it is used."""
