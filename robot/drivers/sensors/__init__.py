"""Drivers of sensors, and the contracts of sensors and boards of analogue inputs."""
