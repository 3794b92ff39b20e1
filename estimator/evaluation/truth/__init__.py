"""The true body, which only the scorer may read: search, exploration and physics never do.

================================= =================================================================
``urdf.read_urdf``                parses a URDF file
``body.true_limbs``               what it says, in the words of a genome: limbs with lengths
``robot.check_robot``             whether it is the robot that a run talked to
================================= =================================================================
"""
