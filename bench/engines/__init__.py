"""``make compare-engines``: statics against simulation, on random bodies of every problem.

=================== ===============================================================================
``bodies``          random bodies and motor programs, each from a seed of its own
``runs``            which engines simulate every body, in which worlds
``simulate``        simulates what was not simulated yet, in worker processes
``figures``         differences, shares, and the risk–coverage curve of the path margin
``causes``          why statics disagrees where the engines agree with each other
``plots``, ``page`` pictures and tables
=================== ===============================================================================

Simulations are kept in ``runs/engines``, so that the command can be interrupted and goes on where
it was, or with more bodies. Statics itself is computed anew each time, since it takes no time.
"""
