"""The paper's method: a population of models is optimised until it fits what was felt.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``method``              the paper's genetic algorithm
``reference_check``     the leading models simulated again in the reference
``modelling``           fits the population to the observations, generation by generation
``fit``                 how badly many models fit, with a verdict as early as is exact
``objectives``          how errors of interactions become one figure of a model
``subjective_error``    the paper's error of one model
======================= =========================================================================
"""
