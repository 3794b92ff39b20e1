"""Conformance suite: ``python -m protocol.conformance URI`` tries a robot against ``SPEC.md``.

The suite knows the robot only by its wire and trusts nothing: a check sends what no client of ours
could, and looks at every byte that comes back. A failure is reported once, under its clause; checks
that build on that clause are skipped. Without ``--move`` no request is sent that a robot, however
faulty, could take for an order to move or to go limp.
"""
