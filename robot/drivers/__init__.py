"""Drivers of the robot's electronics.

Rules that all of them keep: they are given the buses and a clock, and start no threads; they check
ranges themselves, because the boards ignore bad input silently; every wait has a deadline; whatever
goes wrong on the link comes out as a ``DeviceError`` with a sentence on what to check.
"""
