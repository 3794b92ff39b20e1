"""The simulated body and what its sensors are exposed to.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``engines``             the engines by name, and ``open_world``
``simulation``          ``World``: a body on a plane, its servos and sensors, in any engine
``pybullet_world``      the world in PyBullet
``mujoco_world``        the world in MuJoCo
``body``                a URDF file, checked, with the names that a robot needs
``body_checks``         what a schema cannot check of it
``urdf``                the subset of URDF that a body may use, as declarations
``urdf_file``           reads a file: declarations, faults, what is taken otherwise
``customary_urdf``      what files of others have, rewritten into the subset
``mesh_box``            the box around a mesh
``frames``              poses as URDF writes them
``sensor_noise``        noise by configuration, the same again for the same seed
======================= =========================================================================
"""
