"""``make compare-engines``: statics against simulation, on random bodies of every problem.

Simulations are kept in ``runs/engines``, so that the command can be interrupted and goes on where
it was, or with more bodies. Statics itself is computed anew each time, since it takes no time.
"""
