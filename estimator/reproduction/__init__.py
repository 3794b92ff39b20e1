"""The paper's figures and claims, from real runs against simulated robots.

======================= ==================================================================
``reproduce``           the command: does the runs that figures need, and draws them
``report``              ``report.md``, the same as one page, and ``runs.csv``
``figures``             a module per figure
``claims``              the paper's claims, declared before the runs
``finished_run``        what the figures read of a finished run
``plan``                seeds, experimental variants and runs, fixed in code before any run
``paper_run``           one run from start to end, and what it left
``output_files``        pictures, tables and numbers, each written as a whole or not at all
======================= ==================================================================
"""
