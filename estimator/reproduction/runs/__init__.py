"""The runs of a reproduction.

======================= ==================================================================
``plan``                seeds, experimental variants and runs, fixed in code before any run
``robot_process``       a ``sim-robotd`` process for one run
``single_run``          one run from start to end
``run_processes``       runs in parallel on this computer
``runs_on_cluster``     runs on other computers
``progress``            how far a reproduction is, and how long the rest will take
``ledger``              the record of a reproduction: its budget and its sessions
``finished_run``        what the figures read of a finished run
``run_summary``         a run as one line of a list
======================= ==================================================================
"""
