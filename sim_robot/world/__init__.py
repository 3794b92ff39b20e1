"""The simulated body and what its sensors are exposed to.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``simulation``          ``World``: a PyBullet body on a plane, its servos and sensors
``body``                a URDF file, checked, with the names that a robot needs
``urdf``                the subset of URDF that a body may use
``sensor_noise``        noise by configuration, the same again for the same seed
======================= =========================================================================
"""
