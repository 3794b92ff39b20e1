"""The simulated robot, ``sim-robotd``: a package of bodyschema.

The daemon of ``robot`` on emulated electronics over a simulated body; the bodies that ship are in
``bodies``.
"""
