"""Finds out a robot's body from what it feels when it moves. ``docs/architecture.md`` has the plan.

============================ ====================================================================
For                          Use
============================ ====================================================================
a run from start to end      ``run.identify`` and ``run.resume``, with an ``Order``; they return a
                             ``report.result.Result``
a run on disk                ``store.RunStore``: settings, interactions, generations, checkpoint
where readings come from     ``robot_link.open_robot``: a robot, a table by hand, a recorded run
what is to be found          ``problem.Problem``, a TOML file; ``genome.Genome``: genes to bodies
a body                       ``morphology.Morphology`` and ``part_frames``, its kinematics;
                             ``limbs.limbs``: what moves as one piece
what a body feels at rest    ``physics.base.Physics``: ``physics.pybullet.PyBulletPhysics``,
                             ``physics.statics.StaticsPhysics``; ``backends``: by name, in
                             processes (``physics.pool``) or on a cluster (``physics.dask``)
how badly it fits            ``error``: the paper's subjective error; ``fit``: of many models
the search                   ``search.deterministic_crowding.DeterministicCrowding``, ask and tell
how good a run is            ``score.score``: beside the true body (objective error);
                             ``validate.validate``: on fresh motor programs (prediction error)
whether a robot is fit       ``doctor.examine``
the paper's figures          ``reproduction``
what can go wrong            ``errors``; all derive from ``protocol.errors.BodyschemaError``
============================ ====================================================================

``cli`` is the command line over all of this. Only ``score``, ``configurations`` and
``reproduction`` look at a true body (``truth``); nothing that searches can.
"""
