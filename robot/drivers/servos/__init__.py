"""Drivers of servo boards.

=================== =============================================================================
``servo_bus``       the contract of a servo driver: ``ServoSettings``, ``ServoBus``
``sv203``           Pontech SV203 servo boards (plain, B, C) on a serial line
``sv203_line``      what is written on that line, and answered
``pca9685``         NXP PCA9685 servo boards on an I²C bus
``pca9685_board``   one such board by its registers
=================== =============================================================================
"""
