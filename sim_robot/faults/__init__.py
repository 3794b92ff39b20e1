"""Faults that are injected on request.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``fault_panel``         which fault, from when on, for how long
``control_socket``      a socket through which faults are injected
======================= =========================================================================
"""
