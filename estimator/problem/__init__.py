"""Problems: what is known about a robot, and what is to be found.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``problem``             ``Problem``: a TOML file, checked, and written out for a robot
``genome``              ``Genome``: gene arrays in [0, 1] that encode bodies
``sections``            the sections of a problem file, as declarations
``values``              their values, and the sentence that says what is wrong with one
``template``            "all joints" and "one such part per joint", for a particular robot
======================= =========================================================================

The problems that ship are in ``library``.
"""
