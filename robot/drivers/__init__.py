"""Drivers of the robot's electronics.

=============== =================================================================================
Room or module  What is in it
=============== =================================================================================
``registry``    which drivers there are: ours, and those of other distributions
``servos``      what moves the joints: servo boards
``sensors``     accelerometers, touch and distance sensors
``daq``         boards of analogue inputs, for the sensors that are connected to one
``buses``       how a driver opens its link; the seam to a simulated robot
``links``       serial lines, I²C buses, I/O ports, output lines, the inputs of a board
``guard``       opens a driver, and stands between it and whoever uses it
=============== =================================================================================

A room imports only from those below it; ``servos``, ``sensors`` and ``daq`` know nothing of each
other.

Rules that all of them keep: they are given the buses and a clock, and start no threads; they check
ranges themselves, because the boards ignore bad input silently; every wait has a deadline; whatever
goes wrong on the link comes out as a ``DeviceError`` with a sentence on what to check.
"""
