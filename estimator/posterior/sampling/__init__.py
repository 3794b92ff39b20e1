"""Samples of the posterior, after each interaction.

================= ===============================================================================
Module            What is in it
================= ===============================================================================
``sampler``       ``Sampler``: discovers, weighs and samples
``exploring``     the posterior while the readings cannot tell of all parts
``agreement``     what the populations have found, and whether it can be all
``weighing``      modes weighed by their evidence, and samples drawn by these weights
``evidence``      how much probability each set of attachments holds
================= ===============================================================================
"""
