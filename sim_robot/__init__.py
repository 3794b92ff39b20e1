"""The simulated robot, ``sim-robotd``: a package of bodyschema.

================ ===================================================================================
Name             What is in it
================ ===================================================================================
``command_line`` the command line
``simulator``    the daemon of ``robot`` on emulated electronics over a simulated world
``faults``       what can go wrong, and the socket through which it is injected
``world``        the simulated body and what its sensors are exposed to
``electronics``  what drivers talk to in place of devices
``errors``       errors in what a simulated robot is given
================ ===================================================================================

Each imports only from those below it, and from ``robot`` and ``protocol``. The bodies that ship are
in ``bodies``.
"""
