"""Finds out a robot's body from what it feels when it moves. ``docs/architecture.md`` has the plan.

============================ ====================================================================
For                          Use
============================ ====================================================================
a run from start to end      ``identification.run``: ``identify`` and ``resume``, with an
                             ``Order``
a run on disk                ``storage.store.RunStore``: settings, interactions, generations
a run in numbers             ``report.result.Result``
where readings come from     ``robot_link.open_robot``: a robot, a table by hand, a recorded run
what is to be found          ``problem.problem.Problem``, a TOML file; ``problem.genome.Genome``:
                             genes to bodies
a body                       ``body.morphology.Morphology`` and ``part_frames``, its kinematics;
                             ``body.limbs.limbs``: what moves as one piece
what a body feels at rest    ``physics.base.Physics``: ``physics.pybullet.PyBulletPhysics``,
                             ``physics.statics.StaticsPhysics``; ``physics.backends``: by name,
                             in processes or on a cluster
how badly it fits            ``identification.subjective_error``: the paper's; ``fit``: of many
the search                   ``search.deterministic_crowding.DeterministicCrowding``, ask and tell
how good a run is            ``evaluation.score.score``: beside the true body (objective error);
                             ``evaluation.validate.validate``: on fresh motor programs
                             (prediction error)
whether a robot is fit       ``cli.examination.examine``
the paper's figures          ``reproduction``
what packages add            ``plugins.Registry``: implementations by name, ours and theirs
what computed it             ``versions``
what can go wrong            ``errors``; all derive from ``protocol.errors.BodyschemaError``
============================ ====================================================================

From the top down: ``cli``, ``reproduction``, ``report``, ``evaluation``, ``identification``,
``posterior``, ``robot_link``, ``storage``, ``problem``, ``physics``, ``search``, ``parallel``,
``readings``, ``body``. A room imports only from those below it. Only ``evaluation`` and
``reproduction`` look at a true body (``evaluation.truth``); nothing that searches can.
"""
