"""The files that describe a robot, read key by key.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``robot_config``        ``robot.toml``: what is connected where
``calibration_file``    ``calibration.toml``: what ``robotd calibrate`` writes
``device_tables``       the tables that both share: joints and sensors
``joint_calibration``   counts of the servo board to joint angles and back
======================= =========================================================================
"""
