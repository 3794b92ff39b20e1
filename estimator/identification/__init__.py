"""The estimation-exploration loop: act, sense, model.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``run``                 ``identify`` and ``resume``: a run from start to end
``loop``                the loop itself
``exploration``         exploration rules: which motor program is performed next
``acting``              performs a motor program so that no crash loses it or repeats it
``modelling``           fits the population to the observations, generation by generation
``fit``                 how badly many models fit, with a verdict as early as is exact
``subjective_error``    the paper's error of one model
``reference_check``     the leading models simulated again in the reference
``final_population``    the models that a run ends with, best first
``listener``            what a run tells those who watch it
======================= =========================================================================
"""
