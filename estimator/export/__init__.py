"""Bodies in the formats of simulators.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``formats``             the formats by name, and a body of a problem in one of them
``urdf``                for ROS, PyBullet and ``sim-robotd --body``
``mjcf``                for MuJoCo
``description``         what they all say: links with masses, joints with limits
======================= =========================================================================
"""
