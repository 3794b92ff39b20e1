"""The simulated robot, ``sim-robotd``: a package of bodyschema.

======================= =========================================================================
Room                    What is in it
======================= =========================================================================
``cli``                 the command line
``simulator``           the daemon of ``robot`` on emulated electronics over a simulated body
``faults``              faults on order, and the socket that orders them
``world``               the body, the engines, what its sensors are exposed to, noise
``electronics``         emulated boards and sensors
``errors``              what can be wrong with what a simulated robot is given
======================= =========================================================================

A room imports only from those below it, from ``robot`` and from ``protocol``. The bodies that ship
are in ``bodies``.
"""
