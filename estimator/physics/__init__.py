"""Physics back-ends: bodies and motor programs in, readings out.

==================================== ==========================================================
``base.Physics``                     the interface of every back-end; the search knows no more
``base.Abilities``                   what a back-end declares that it can do beyond it
``base.Readings``                    sensor readings of bodies at rest, as arrays
``base.WorldSettings``               the world that bodies are simulated in
``backends``                         the back-ends by name, and the ways to run them
``pybullet.PyBulletPhysics``         simulates 300 steps of 1/60 s in this process
``mujoco.MuJoCoPhysics``             simulates the same in another engine
``rest``                             when a simulated body rests
``statics.StaticsPhysics``           computes the resting pose, in threads of this process
``equivalence``                      whether two bodies can be told apart by what they feel
``pool.PhysicsPool``                 runs a back-end in worker processes, here or on a cluster
``kernel``                           the compiled part of ``StaticsPhysics``
==================================== ==========================================================
"""
