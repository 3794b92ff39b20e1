"""Does a robot speak the protocol? ``python -m protocol.conformance URI`` tries each clause.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``registry``            ``Check``, the decorator that makes one
``expectations``        what a check raises: ``Broken`` and ``Untried``
``settings``            what the suite may do, and how long it waits
``line``, ``bench``     raw connections, clients in a session, and what all checks share
``trace``               frames for people
``basics``              the checks on which the others build
``transport`` … \
``waiting``             the checks, by subject
``suite``               runs them, and says which clauses hold
======================= =========================================================================

The suite knows the robot only by its wire. It trusts nothing: a check sends what no client of ours
could, and looks at every byte that comes back. What is broken is said once, under its clause: a
check that builds on it is not tried, and neither is one that would wait for the same in vain.
Without ``--move``, no request is ever sent that a robot, however broken, could take for an order to
move or to go limp.
"""
