"""The command ``estimator``.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``identify``, …         a subcommand each, by its name: ``resume``, ``show``, ``score``,
                        ``validate``, ``export``, ``report``, ``compare``,
                        ``watch``, ``doctor``, ``reproduce``
``command_line``        the list of the subcommands
``live_view``           the live page of a run, in a process of its own
``options``             options that several subcommands share
``console``             output to the terminal, and the end of a command that failed
``screen``              the progress display of a run
``examination``         whether a robot can be reached and identified, and if not, why
======================= =========================================================================

A subcommand's module has a function ``command``: its signature declares the options, its docstring
is the help.
"""
