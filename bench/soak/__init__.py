"""Hours of random commands, faults and clients against a simulated robot: ``make soak``.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``__main__``            the command
``crowd``               everybody who is at the robot, and what must never come of it
``vitals``              memory, threads and files of a daemon at one moment
======================= =========================================================================
"""
