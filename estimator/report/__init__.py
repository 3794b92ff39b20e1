"""What a run leaves for people and programs.

========================== ===============================================================
``result.summarise``       a run in numbers: the content of ``result.json``
``plots``                  errors and leg lengths over generations, as in the paper's Figure 2
``run_files.write_report`` all derived files of a run directory
``terminal_tables``        the same for a terminal
========================== ===============================================================
"""
