"""Studies: many runs on simulated robots, whose figures are published.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``harness``             does the runs of a study, here or on a cluster, and resumes them
``ledger``              what was asked, the sessions that worked on it, and their commits
``robot_process``       a ``sim-robotd`` process for one run
======================= =========================================================================
"""
