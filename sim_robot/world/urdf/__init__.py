"""URDF files: the subset that a body may use, and what files of others are taken as.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``reading``             reads a file: declarations, faults, what is taken otherwise
``declarations``        the subset of URDF that a body may use
``customary``           what files of others have, rewritten into the subset
``customary_tree``      how their links hang together: the main body, links without mass, the order
``customary_joints``    their joints as servos: ranges, zeros, torques
``foreign_words``       words of other programs, ignored aloud unless they look misspelt
``mesh_box``            the box around a mesh
``elements``            XML elements: their poses, numbers and ends
``frames``              poses as URDF writes them
======================= =========================================================================
"""
