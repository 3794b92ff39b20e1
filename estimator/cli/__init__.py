"""The command ``estimator``.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``commands``            every subcommand with its options
``console``             what is said at a terminal, and how a command ends that went wrong
``screen``              a run as a person watches it: a progress bar, the time left
``doctor``              whether a robot can be reached and identified, and if not, why
======================= =========================================================================
"""
