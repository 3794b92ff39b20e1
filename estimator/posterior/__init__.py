"""The posterior: which bodies explain the readings, and how probable each is.

================= ===============================================================================
Room or module    What is in it
================= ===============================================================================
``fitted``        ``FittedPosterior``: what a run knows, for whoever builds on it
``belief``        its summary
``sampling``      ``Sampler``: discovers, weighs and samples, interaction after interaction
``discovery``     the search that says where the posterior is
``checks``        does any body explain the readings, and what does a simulator say?
``alike``         which samples no sensor can tell from the best body's attachments
``information``   how much an interaction has told
``posterior``     samples and modes, as data
``chains``        chains on levels of noise, and what they propose
``model``         how likely readings are, given a body; what is unknown of a body
================= ===============================================================================

A room imports only from those below it.
"""
