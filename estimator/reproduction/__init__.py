"""The paper's figures and claims, from real runs against simulated robots.

======================= ==================================================================
``plan``                seeds and runs, fixed in code; ``variants`` in the caption's order
``robot_process``       a ``sim-robotd`` of one's own
``single_run``          one run from start to end
``workers``             runs in parallel; ``overall`` tells how far they are
``on_cluster``          the same on other computers
``ledger``              the directory of a reproduction
``finished``            what the figures read of a finished run
``figure2`` … 6         one figure each; ``scene`` and ``camera`` for Figure 5
``claims``              the paper's claims, declared before the runs; ``statistics``
``report``              all of it for people
``reproduce``           the command
======================= ==================================================================
"""
