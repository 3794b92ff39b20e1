"""Parallel work: executors on this computer, and on a cluster.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``executors``           this process, processes and threads of this computer
``cluster``             the workers of a Dask cluster
======================= =========================================================================
"""
