"""The search for bodies that explain the readings: it says where the posterior is.

================= ===============================================================================
Module            What is in it
================= ===============================================================================
``discovery``     ``Discovery``: what is tried, in which order, and what is kept
``neighbours``    better bodies near others, of limbs put on together
``recombination`` bodies with subtrees of others
``ranking``       many points ranked, most of them by a few interactions only
``part_trees``    bodies as trees of parts: what is changed together
================= ===============================================================================
"""
