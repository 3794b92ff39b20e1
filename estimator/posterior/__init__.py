"""The posterior: which bodies explain the readings, and how probable each is.

================= ===============================================================================
Room or module    What is in it
================= ===============================================================================
``belief``        a posterior as it is kept and told
``sampling``      ``Sampler``: discovers, weighs and samples, interaction after interaction
``checks``        does any body explain the readings, and what does a simulator say?
``alike``         which samples no sensor can tell from the best body's attachments
``information``   how much an interaction has told
``posterior``     samples and modes, as data
``model``         how likely readings are, given a body; what is unknown of a body
================= ===============================================================================
"""
