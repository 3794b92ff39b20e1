"""How good a run is: against the true body, and on fresh motor programs.

================= ==================================================================================
Name              What is in it
================= ==================================================================================
``validate``      the prediction error, which needs no truth
``score``         the objective error
``length_search`` whether other attachments are right up to equivalence
``attachments``   the attachments of a model's parts, compared with the true ones
``truth``         the true body of a robot, which only the scorer may read
================= ==================================================================================

Each imports only from those below it.
"""
