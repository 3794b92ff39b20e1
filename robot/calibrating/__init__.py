"""The guided session behind ``robotd calibrate``.

=================  ===============================================================================
``dialogue``       Questions and answers on a terminal; ``q``, Ctrl-C and end of input leave
``joints``         Counts ↔ angle: a person moves the count and types the measured angle
``accelerometer``  Six positions, or level only
``gauges``         Tare of the free foot, and one known load
``distance``       Zero, and one known height
``session``        The order of it all, and what comes out
=================  ===============================================================================

Nothing here touches a file, and whenever a session ends, the robot holds.
"""
