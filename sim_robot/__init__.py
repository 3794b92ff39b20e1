"""The simulated robot, ``sim-robotd``: a package of bodyschema.

``simulator`` is the daemon of ``robot`` on emulated ``electronics`` over a simulated ``world``;
``faults`` injects what can go wrong. The bodies that ship are in ``bodies``.
"""
