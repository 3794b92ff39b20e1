"""Drivers of boards with analogue inputs: the table ``[daq]`` of ``robot.toml``.

=================== =============================================================================
``dmm32``           Diamond Systems DMM-32-AT, 32X-AT and 32DX-AT
``comedi``          any board through Linux' comedi, in the DMM-32's place
``ads1115``         TI ADS1115 chips on an I²C bus, in the DMM-32's place
=================== =============================================================================

Their contract stands beside those of the sensors, in ``robot.drivers.sensors.contracts``.
"""
