"""Drivers of sensors and of boards of analogue inputs, and their contracts."""
