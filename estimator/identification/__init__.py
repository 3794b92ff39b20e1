"""The estimation-exploration loop: act, sense, model.

======================= =========================================================================
Room or module          What is in it
======================= =========================================================================
``run``                 ``identify`` and ``resume``: a run from start to end
``order``               what a person asks of a run
``loop``                the loop itself
``posterior_method``    samples of all bodies that explain the readings, and how sure it is
``doubting``            bodies that deviate from the problem, and what they take from a belief
``acting``              performs a motor program so that no crash loses it or repeats it
``method``              what a method does: learns from interactions, gives a posterior
``next_program``        the next motor program, by an exploration rule
``paper``               the paper's method, and the objectives
``listener``            what a run tells those who watch it
======================= =========================================================================

A room imports only from those below it.
"""
