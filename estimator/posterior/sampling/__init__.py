"""Samples of the posterior, after each interaction.

================= ===============================================================================
Module            What is in it
================= ===============================================================================
``sampler``       ``Sampler``: discovers, weighs and samples
``wandering``     the posterior while the readings cannot tell of all parts
``discovery``     the search that says where the posterior is
``agreement``     what the populations have met, and whether it can be all
``weighing``      modes weighed by their evidence, and samples drawn by these weights
``evidence``      how much probability each set of attachments holds
``population``    chains on levels of noise: evolutionary Monte Carlo
``moves``         their proposals
``neighbours``    better bodies near others, of limbs put on together
``recombination`` bodies with subtrees of others
``ranking``       many points ranked, most of them by a few interactions only
``part_trees``    bodies as trees of parts: what is changed together
``rows``          other ways to put one part on, and who then has to move
================= ===============================================================================
"""
