"""The simulated body and what its sensors are exposed to.

================== =================================================================================
Name               What is in it
================== =================================================================================
``pybullet_world`` the world in PyBullet
``mujoco_world``   the world in MuJoCo
``simulation``     a body on a plane and its servos, whatever the engine
``sensor_noise``   the noise of sensors
``damage``         what can happen to a body while it runs
``body``           a body, with the names that a robot needs
``urdf``           URDF files: what may be in them, and how files of others are normalised
================== =================================================================================

Each imports only from those below it.
"""
