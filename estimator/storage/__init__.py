"""A run on disk.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``store``               ``RunStore``: a run directory that survives ``kill -9`` at any instant
``records``             settings, interactions, generations and predictions, as they are kept
``beliefs``             what is believed of the body after an interaction, as it is kept
``database``            the SQLite file: tables, and transactions that survive a power cut
``search_end``          what came of a population when its search was over
``validations``         predictions of motor programs, and what came of them
``locking``             a directory for one process at a time
======================= =========================================================================
"""
