"""URDF files: what a body may have in them, and what files of others are taken as.

================== ==============================================================================
Module             What is in it
================== ==============================================================================
``reading``        reads a file: bounds, XML, xacro, words of other programs, links and joints
``checks``         what cannot be simulated of a body whose values are right by themselves
``normalisation``  what files of others have, made the body that is simulated
``inertia``        which inertia a link can have, and what it is given otherwise
``meshes``         the box around a mesh
``declarations``   what a URDF file says: links, joints, shapes and poses
================== ==============================================================================
"""
