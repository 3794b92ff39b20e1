"""Hours of random commands, faults and clients against a simulated robot: ``make soak``.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``__main__``            the command
``crowd``               the clients of the robot, and the invariants that are checked
``vitals``              memory, threads and files of a daemon at one moment
======================= =========================================================================
"""
