"""From volts and millimetres to tilt, touch and clearance.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``sensors``             ``Sensing``: reads all sensors of a robot and converts what they say
``touch``               a strain gauge's force becomes one bit
``settling``            whether the robot has come to rest
``plausibility``        readings that cannot be, from sensors that still answer
``raw_samples``         unconverted samples, for calibration and diagnosis
======================= =========================================================================
"""
