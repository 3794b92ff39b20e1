"""What a run leaves for people and programs.

========================== ===============================================================
``result.summarise``       a run in numbers: the content of ``result.json``
``posterior_summary``      the posterior in it: attachments with probabilities, intervals, rivals
``plots``                  errors and leg lengths over generations, as in the paper's Figure 2
``posterior_plots``        probabilities and intervals over interactions
``posterior_csv``          the samples, a row each
``formats``                formats by name, ours and those of packages
``run_files.write_report`` all derived files of a run directory
``terminal_tables``        the paper's result and scores at a terminal
``posterior_tables``       the posterior at a terminal
``plain_table``            how both look
========================== ===============================================================
"""
