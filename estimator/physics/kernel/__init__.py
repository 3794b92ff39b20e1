"""The compiled part of the statics back-end.

=============== ===================================================================================
``compiling``   machine code: made once, kept on disk, announced where it takes seconds
``vectors``     three numbers as one
``links``       a tree of parts as rigid links, with the points that may touch the ground
``kinematics``  where links and points are at each step of the slew
``contact``     which points touch, and whether the centre of mass is over them
``rolling``     how a body gets to rest: about a vertex or an edge, or on with its three contacts
``path``        one body from the planar pose to its motor program, and how sure its path is
``batch``       many bodies
=============== ===================================================================================

Everything here is plain arrays and numbers. What the arrays' columns are is written in ``links``.
"""
