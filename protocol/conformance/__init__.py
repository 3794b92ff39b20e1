"""Does a robot speak the protocol? ``python -m protocol.conformance URI`` tries each clause.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``suite``               runs the checks and reports which clauses hold
``checks``              the checks, a module per subject
``registry``            ``Check``, and the decorator that registers one
``robot_under_test``    the robot under test, and clients that talk to it
``raw_connection``      sends arbitrary frames, checks every reply, shows frames to people; what
                        the suite may do; ``Failed`` and ``Skipped``, which a check raises
======================= =========================================================================

The suite knows the robot only by its wire. It trusts nothing: a check sends what no client of ours
could, and looks at every byte that comes back. What does not hold is said once, under its clause: a
check that builds on it is skipped, and so is one that would wait for the same in vain.
Without ``--move``, no request is ever sent that a robot, however broken, could take for an order to
move or to go limp.
"""
