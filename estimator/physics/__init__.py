"""Physics back-ends: bodies and motor programs in, predicted readings out.

=============== ====================================================================================
Name            What is in it
=============== ====================================================================================
``backends``    back-ends by name, and where each of them runs
``equivalence`` whether two bodies are indistinguishable by their sensors
``statics``     bodies at rest, computed
``kernel``      the compiled part of ``statics``
``pybullet``    bodies simulated in PyBullet
``mujoco``      bodies simulated in MuJoCo
``rest``        when a simulated body rests, and what its sensors then read
``base``        what a back-end is: ``Physics``, ``ArrayPhysics``
=============== ====================================================================================

Each imports only from those below it.
"""
