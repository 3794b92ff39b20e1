"""Drivers of the robot's electronics.

=====================  ===========================================================================
``servo_bus``          The contract of a servo driver: ``ServoSettings``, ``ServoBus``
``sensor_drivers``     The contracts of accelerometers, touch and distance sensors, and boards
``registry``           Which drivers there are: ours, and those of other distributions
``buses``              How a driver opens its link; the seam to a simulated robot
``sv203``              Pontech SV203 servo boards (plain, B, C) on a serial line
``sv203_line``         What is written on that line, and answered
``serial_line``        Opens a serial line
``pca9685``            NXP PCA9685 servo boards on an I²C bus
``pca9685_board``      One such board by its registers
``dmm32``              Diamond Systems DMM-32-AT, 32X-AT and 32DX-AT analogue inputs
``portio``             The I/O ports below it
``comedi``             Analogue inputs through Linux' comedi, in the DMM-32's place
``ads1115``            TI ADS1115 analogue inputs on an I²C bus, in the DMM-32's place
``analogue_inputs``    The inputs of one board, shared by the sensors on them
``analogue_sensors``   Accelerometer and strain gauges on analogue inputs
``switch``             A switch with its resistor on an analogue input
``axes``               Three axes with their calibration, whatever their unit
``mpu6050``            InvenSense MPU-6050 accelerometer
``vl6180x``            ST VL6180X distance sensor
``gpio_line``          An output line of the computer, for the PCA9685's output enable
``i2c``                The I²C bus below it and the other chips
=====================  ===========================================================================

Rules that all of them keep: they are given the buses and a clock, and start no threads; they check
ranges themselves, because the boards ignore bad input silently; every wait has a deadline; whatever
goes wrong on the link comes out as a ``DeviceError`` with a sentence on what to check.
"""
