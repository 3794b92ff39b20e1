"""More than one process: children on this computer, workers on others.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``worker_processes``    processes that do one task after the other for this one
``child_process``       a child process that ends when its parent does
``cluster``             a Dask cluster that works for this process
======================= =========================================================================
"""
