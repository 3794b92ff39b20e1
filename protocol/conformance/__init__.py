"""Does a robot speak the protocol? ``python -m protocol.conformance URI`` tries each clause.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``suite``               runs the checks and reports which clauses hold
``checks``              the checks, a module per subject
``settings``            what the suite may do, and how long it waits
``registry``            ``Check``, and the decorator that registers one
``robot_on_trial``      the robot under trial, and clients that talk to it
``raw_connection``      sends arbitrary frames and checks every reply
``frame_trace``         formats frames for people: in hex, and decoded
``expectations``        what a check raises: ``Broken`` and ``Untried``
======================= =========================================================================

The suite knows the robot only by its wire. It trusts nothing: a check sends what no client of ours
could, and looks at every byte that comes back. What is broken is said once, under its clause: a
check that builds on it is not tried, and neither is one that would wait for the same in vain.
Without ``--move``, no request is ever sent that a robot, however broken, could take for an order to
move or to go limp.
"""
