"""The daemon of the robot, ``robotd``: a package of bodyschema.

======================= =========================================================================
Name                    What is in it
======================= =========================================================================
``cli``                 the command line, a module per subcommand
``service``             puts a robot together from its configuration, and serves it
``diagnosis``           ``robotd doctor``: looks at each device, joint and sensor
``calibration``         ``robotd calibrate``: the guided session
``trial``               ``robotd try``: one joint by hand, every sensor live
``control``             the control loop and the choreography of an interaction
``devices``             a robot's devices: opened, and made to work again after a fault
``configuration``       ``robot.toml`` and ``calibration.toml``
``sensing``             volts and millimetres become tilt, touch and clearance
``drivers``             the electronics
``uncertainty``         how well something was calibrated
``toml_sections``       reads a TOML file so that a wrong key is refused by name
``host``                the computer that it runs on: clocks, log, service manager
``errors``              what can go wrong
======================= =========================================================================

Each imports only from those below it, and from ``protocol``; nothing here imports numpy.
"""
