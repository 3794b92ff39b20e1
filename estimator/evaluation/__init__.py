"""How good the models are that a run has found.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``score``               the objective error: the distance from the true body
``attachments``         how parts are attached, compared with the true body part by part
``equivalence``         whether two bodies can be told apart by what they feel
``length_search``       whether they can at all lengths
``validate``            the prediction error: fresh motor programs, predicted and then performed
``truth``               the true body, which nothing else may read
======================= =========================================================================
"""
