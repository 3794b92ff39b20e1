"""The files that describe a robot, ``robot.toml`` and ``calibration.toml``."""
