"""Bodies: trees of parts.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``morphology``          one body, and its forward kinematics
``part_shapes``         where a part of either shape ends, and how large it is
``mounts``              where parts can sit, and how they can turn; the paper's tables
``arrays``              many bodies as arrays, without an object per body
``accelerometer``       what one feels that does not sit straight on the main body
``limbs``               what moves as one piece, with its length and how it is attached
======================= =========================================================================
"""
