"""Drivers of the robot's electronics.

============ =======================================================================================
Name         What is in it
============ =======================================================================================
``registry`` which drivers there are: ours, and those of other distributions
``sensors``  drivers of sensors and of boards of analogue inputs
``guard``    stands between each driver and whatever uses it
``servos``   drivers of servo boards and bus servos
``buses``    the buses of a computer, as drivers open them
``links``    serial lines, I²C buses, I/O ports, output lines, analogue inputs
============ =======================================================================================

Each imports only from those below it.

Rules that all drivers keep: they are given the buses and a clock, and start no threads; they check
ranges themselves, because the boards ignore bad input silently; every wait has a deadline; whatever
goes wrong on the link comes out as a ``DeviceError`` with a sentence on what to check.
"""
