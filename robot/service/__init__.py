"""Puts a robot together from its configuration, and serves it.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``daemon``              devices, control loop, server and signals
``devices``             opens and identifies devices, and makes them work again after a fault
``dry_run``             a robot without any hardware, for trying out an installation
======================= =========================================================================
"""
