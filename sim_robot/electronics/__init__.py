"""Emulated electronics: what the drivers of ``robot`` talk to when there is no robot.

The emulators are told what there is to sense by plain callables, know nothing of bodies, and charge
a clock with the time that each access takes on real electronics. Each has faults to be switched on.
"""
