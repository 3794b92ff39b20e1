"""From what the sensors say to tilt, touch and clearance.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``sensors``             ``Sensing``: reads all sensors of a robot and converts what they say
``touch``               what a touch sensor feels becomes one bit
``settling``            whether the robot has come to rest
``plausibility``        readings that cannot go together
``raw_samples``         unconverted samples, for calibration and diagnosis
======================= =========================================================================
"""
