"""More than one process: children on this computer, workers on others.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``child_process``       processes that work for this one, and end when it does
``cluster``             a Dask cluster that works for this process
======================= =========================================================================
"""
