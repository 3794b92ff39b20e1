"""Response times of ``robotd`` while it moves, and what they cost: ``make latency``.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``__main__``            the command
``prober``              measures round trips, in a process of its own
``echo``                the baseline: a bare ROUTER that sends back what it gets
``viewers``             many viewers in one process
``outboard``            the daemon, with its servo board in another process
======================= =========================================================================
"""
