"""The posterior: which bodies explain the readings, and how probable each is.

===================== ==============================================================================
Name                  What is in it
===================== ==============================================================================
``fitted``            what a run knows of the body, for rules, reports and programs:
                      ``FittedPosterior``
``summary``           what is stored and reported of a posterior
``indistinguishable`` which samples are observationally equivalent to the best body
``sampling``          samples after each interaction, and their weights
``discovery``         the search for bodies that explain the readings
``checks``            whether the fit is adequate, and whether a simulator agrees
``posterior``         weighted samples, and modes, one for each set of attachments
``model``             what is unknown of a body, and how likely readings are, given one
===================== ==============================================================================

Each imports only from those below it.
"""
