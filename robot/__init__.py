"""The daemon of the robot."""
