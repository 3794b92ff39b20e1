"""What a robot felt, wherever it comes from.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``observation``         ``Observation``: what one interaction returned
``plausibility``        what no robot can be and no sensor can read
``readings_csv``        readings as a table that a person can write
======================= =========================================================================
"""
