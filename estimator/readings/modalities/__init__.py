"""What a robot can sense, each kind in one object.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``registry``            the modalities by name
``clearance``           belly to ground
``tilt``                left/right and forward/back
``touch``               which parts meet the ground
``base``                ``Modality``: what such an object knows and does
======================= =========================================================================
"""
