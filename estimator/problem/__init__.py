"""Problems: what is known about a robot, and what is to be found.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``problem``             ``Problem``: a TOML file, checked, and written out for a robot
``genome``              ``Genome``: gene arrays in [0, 1] that encode bodies
``genes``               what each gene decides
``free_mounts``         where parts go that may not share a mount
``outermost_parts``     touch sensors on the parts that carry no other
``attachment_tables``   the mounts and hinges of a problem: of its tables, and of single parts
``nuisances``           what else may be open: density, joint zeros, accelerometer, centre of mass
``sections``            the sections of a problem file, as declarations
``values``              their values, and the sentence that says what is wrong with one
``template``            "all joints" and "one such part per joint", for a particular robot
======================= =========================================================================

The problems that ship are in ``library``.
"""
