"""The estimation-exploration loop: act, sense, model.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``run``                 ``identify`` and ``resume``: a run from start to end
``loop``                the loop itself
``next_program``        the next motor program, by an exploration rule
``acting``              performs a motor program so that no crash loses it or repeats it
``method``              what a method does: learns from interactions, says what it believes
``posterior_method``    samples of all bodies that explain the readings, and how sure it is
``doubting``            bodies that depart from the problem, and what they take from a belief
``paper_method``        the paper's genetic algorithm
``objectives``          how errors of interactions become one figure of a model
``modelling``           fits the population to the observations, generation by generation
``fit``                 how badly many models fit, with a verdict as early as is exact
``subjective_error``    the paper's error of one model
``reference_check``     the leading models simulated again in the reference
``final_population``    the models that a run ends with, best first
``listener``            what a run tells those who watch it
======================= =========================================================================
"""
