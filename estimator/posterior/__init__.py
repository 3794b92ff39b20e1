"""The posterior: which bodies explain the readings, and how probable each is.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``sampler``             ``Sampler``: discovers, weighs and samples, interaction after interaction
``belief``              a posterior as it is kept and told
``verdict``             does any body that the problem allows explain the readings?
``thickness``           would parts of another thickness explain the readings clearly better?
``recheck``             a simulator reweights samples
``information``         how much an interaction has told
``discovery``           the search that says where the posterior is
``wandering``           the posterior while the readings cannot tell of all parts
``evidence``            how much probability each set of attachments holds
``population``          chains on levels of noise: evolutionary Monte Carlo
``moves``               their proposals
``rows``                other ways to put one part on, and who then has to move
``slopes``              how readings change with lengths, and which lengths fit best
``likelihood``          the mixture: how likely an interaction is, given a body
``densities``           how likely one modality's readings are; ``special`` has their functions
``unknowns``            the unit cube that all this is over
``posterior``           samples and modes, as data
======================= =========================================================================
"""
