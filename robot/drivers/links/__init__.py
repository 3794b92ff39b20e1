"""What drivers talk through.

=================== =============================================================================
``serial_line``     opens a serial line
``i2c``             an I²C bus, which may lose an acknowledge, and the registers of a chip on it
``portio``          the I/O ports of a board
``gpio_line``       an output line of the computer, for the PCA9685's output enable
``analogue_inputs`` the inputs of one board, shared by the sensors on them
``device_files``    what else is in ``/dev`` when a device file is not there, or not ours
=================== =============================================================================
"""
