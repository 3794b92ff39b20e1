"""Does a robot speak the protocol? ``python -m protocol.conformance URI`` tries each clause.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``registry``            ``Check``, the decorator that makes one
``expectations``        what a check raises: ``Broken`` and ``Untried``
``line``, ``bench``     raw connections, clients in a session, and what all checks share
``transport`` … \
``waiting``             the checks, by subject
``suite``               runs them, and says which clauses hold
======================= =========================================================================

The suite knows the robot only by its wire. It trusts nothing: a check sends what no client of ours
could, and looks at every byte that comes back. Without ``--move``, no request is ever sent that a
robot, however broken, could take for an order to move or to go limp.
"""
