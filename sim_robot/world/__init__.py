"""The simulated body and what its sensors are exposed to.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``engines``             the engines by name, and ``open_world``
``simulation``          ``World``: a body on a plane, its servos and sensors, in any engine
``pybullet_world``      the world in PyBullet
``mujoco_world``        the world in MuJoCo
``body``                a URDF file, checked, with the names that a robot needs
``urdf``                URDF files: the subset, and what files of others are taken as
``sensor_noise``        noise by configuration, the same again for the same seed
======================= =========================================================================
"""
