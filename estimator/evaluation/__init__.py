"""How good the models are that a run has found.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``score``               the objective error: the distance from the true body
``attachments``         how parts are attached, compared with the true body part by part
``length_search``       whether attachments other than the true ones feel the same at some lengths
``validate``            the prediction error: fresh motor programs, predicted and then performed
``truth``               the true body, which nothing else may read
======================= =========================================================================
"""
