"""The command ``estimator``.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``identify``, …         a subcommand each, by its name: ``resume``, ``show``, ``score``,
                        ``validate``, ``doctor``, ``reproduce``
``command_line``        the list of the subcommands
``options``             options that several subcommands share
``console``             what is said at a terminal, and how a command ends that went wrong
``screen``              a run as a person watches it: a progress bar, the time left
``examination``         whether a robot can be reached and identified, and if not, why
======================= =========================================================================

A subcommand's module has a function ``command``: its signature declares the options, its docstring
is the help.
"""
