"""Drivers of the robot's electronics.

=================  ===============================================================================
``sv203``          Pontech SV203 servo board (plain, B, C) on a serial line: ``open_serial``,
                   ``SV203``
``dmm32``          Diamond Systems DMM-32-AT, 32X-AT and 32DX-AT analogue inputs: ``DMM32``
``portio``         The I/O ports below it: ``PortIO``, ``DevPort``, ``open_dev_port``
``vl6180x``        ST VL6180X distance sensor: ``VL6180X``
``i2c``            The bus below it: ``I2CBus``, ``open_i2c``
=================  ===============================================================================

Rules that all of them keep: they are given an opened link and a clock, and start no threads; they
check ranges themselves, because the boards ignore bad input silently; every wait has a deadline;
whatever goes wrong on the link comes out as a ``DeviceError`` with a sentence on what to check.
"""
