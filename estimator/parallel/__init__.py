"""Parallel work: processes on this computer, workers of a cluster.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``workers``             who does tasks: this process, others, or a cluster
``threads``             threads that share out rows of arrays
``worker_processes``    processes that do tasks for this one
``child_process``       a child process that ends when its parent does
``cluster``             the workers of a Dask cluster
======================= =========================================================================
"""
