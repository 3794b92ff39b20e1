"""What a run leaves for people and programs.

========================== ===============================================================
``run_files.write_report`` all derived files of a run directory
``comparison``             runs side by side
``page``                   ``report.html``
``bodies``                 bodies as solids, pictures, and links to be posed
``plots``                  the plots of a run, and how legs look in all of them
``tables``                 what a person reads in a terminal
``evaluation_files``       what ``score`` and ``validate`` leave beside a run
``formats``                formats by name, ours and those of packages
``summarise``              a run in numbers, from its store
``result_schema``          the JSON Schema of ``result.json``
``result``                 what that file holds
``posterior``              the posterior in it, its verdict on fit, and its samples
========================== ===============================================================

A room imports only from those below it; ``plots`` and ``tables`` know nothing of each other.
"""
