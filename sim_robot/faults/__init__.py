"""Things that go wrong on order.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``fault_panel``         which fault, from when on, for how long
``control_socket``      who can reach it can make things fail
``network_proxy``       bad networks between a client and a robot
======================= =========================================================================
"""
