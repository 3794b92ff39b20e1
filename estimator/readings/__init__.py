"""What a robot felt, wherever it comes from.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``modalities``          touch, tilt and clearance: how a reading is checked, compared and said
``observation``         ``Observation``: what one interaction returned
``plausibility``        what no robot can be and no sensor can read
``readings_csv``        readings as a table that a person can write
======================= =========================================================================
"""
