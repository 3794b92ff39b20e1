"""Exploration: which motor program the robot performs next.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``rules``               the rules by name; the rule ``random``
``situation``           what a rule is given, and what it answers
``information``         the rule ``information``: expected information gain, and it in words
``disagreement``        the rule ``disagreement``
``best_programs``       the best programs by any score: candidates, and their refinement
``choosing``            by what they tell, and how sure their predictions are
``few_limbs``           programs that leave most limbs as they lie
``information_gain``    expected information of programs, by nested Monte Carlo
``gain_kernel``         the compiled part of it
======================= =========================================================================
"""
