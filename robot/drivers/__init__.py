"""Drivers of the robot's electronics.

=====================  ===========================================================================
``servo_bus``          The contract of a servo driver: ``ServoSettings``, ``ServoBus``
``sensor_drivers``     The contracts of accelerometers, touch and distance sensors, and boards
``registry``           Which drivers there are: ours, and those of other distributions
``buses``              How a driver opens its link; the seam to a simulated robot
``sv203``              Pontech SV203 servo board (plain, B, C) on a serial line
``serial_line``        The serial line below it
``dmm32``              Diamond Systems DMM-32-AT, 32X-AT and 32DX-AT analogue inputs
``portio``             The I/O ports below it
``comedi``             Analogue inputs through Linux' comedi, in the DMM-32's place
``analogue_inputs``    The inputs of one board, shared by the sensors on them
``analogue_sensors``   Accelerometer and strain gauges on analogue inputs
``vl6180x``            ST VL6180X distance sensor
``i2c``                The I²C bus below it
=====================  ===========================================================================

Rules that all of them keep: they are given the buses and a clock, and start no threads; they check
ranges themselves, because the boards ignore bad input silently; every wait has a deadline; whatever
goes wrong on the link comes out as a ``DeviceError`` with a sentence on what to check.
"""
