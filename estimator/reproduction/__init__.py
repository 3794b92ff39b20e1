"""The paper's figures and claims, from real runs against simulated robots.

======================= ==================================================================
``reproduce``           the command: does the runs that figures need, and draws them
``page``                the same as one page
``report``              ``report.md`` and ``runs.csv``
``figures``             a module per figure
``claims``              the paper's claims, declared before the runs
``runs``                which runs, and how they are done, in parallel or on a cluster
``output_files``        pictures, tables and numbers, each written as a whole or not at all
======================= ==================================================================
"""
