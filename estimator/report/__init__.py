"""What a run leaves for people and programs.

========================== ===============================================================
``result.summarise``       a run in numbers: the content of ``result.json``
``result_schema``          the JSON Schema of that file
``posterior_summary``      the posterior in it: attachments with probabilities, intervals, rivals
``verdict``                whether some body of the problem explains the readings
``run_plots``              the plots of a run
``plots``                  errors and leg lengths over generations, as in the paper's Figure 2
``posterior_plots``        probabilities and intervals over interactions
``prediction_plot``        what was felt beside what is foretold
``leg_styles``             a colour, a marker and a label for each leg
``canvas``                 empty figures; drawn ones as PNG and SVG
``bodies``                 bodies as solids, pictures, and links to be posed
``page``                   ``report.html``
``comparison``             runs side by side
``evaluation_files``       what ``score`` and ``validate`` leave beside a run
``posterior_csv``          the samples, a row each
``formats``                formats by name, ours and those of packages
``run_files.write_report`` all derived files of a run directory
``terminal_tables``        the paper's result and scores at a terminal
``posterior_tables``       the posterior at a terminal
``plain_table``            how both look
========================== ===============================================================
"""
