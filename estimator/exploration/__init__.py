"""Exploration: which motor program the robot performs next."""
