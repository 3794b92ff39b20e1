"""Drivers of boards with analogue inputs: the table ``[daq]`` of ``robot.toml``."""
