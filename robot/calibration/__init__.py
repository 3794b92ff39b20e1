"""The guided session behind ``robotd calibrate``.

===================  =============================================================================
``guided_session``   The order of it all, and what comes out
``questions``        Questions and answers on a terminal; ``q``, Ctrl-C and end of input leave
``oscillators``      MHz of a PCA9685: a person measures how often it pulses
``joints``           Counts to angle: a person moves the count and types the measured angle
``accelerometer``    Six positions, or level only
``strain_gauges``    Tare of the free foot, and one known load
``distance``         Zero, and one known height
===================  =============================================================================

Nothing here touches a file, and whenever a session ends, the robot holds.
"""
