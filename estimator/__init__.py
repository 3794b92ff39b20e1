"""Finds out a robot's body from what it feels when it moves: a package of bodyschema.

``docs/architecture.md`` has the plan. A program needs no more than the names below, which
``__init__.pyi`` lists; ``docs/extending.md`` has examples. The shortest::

    from estimator import RunConfig, identify

    config = RunConfig(robot="tcp://127.0.0.1:5750", problem="topological", seed=1)
    result = identify("runs/first", config)

A name is imported when it is first asked for, so that ``import estimator`` loads no library.

======================= =========================================================================
Name                    What it is
======================= =========================================================================
``identify``            a run from start to end; ``resume`` sees an interrupted one through
``Result``              a run in numbers; ``Listener`` hears of it while it goes on
``load``                what a run knows of the body: ``FittedPosterior``, with ``Attachment``
``Executors``           where a run's work is done: ``on_workers`` makes them of an executor of your
                        own, or of a ``Cluster`` of Dask
``best_programs``       the motor programs that are best by a score of your own
``find_pose``           the motor program after which the robot reads as a ``Goal`` says: ``Pose``
``RunConfig``           what is asked of a run; ``METHODS`` are the methods by name
``BACKENDS``            what a body's sensors read at rest: ``Physics`` is the base class of
                        back-ends, ``ArrayPhysics`` of those that take whole populations,
                        ``PredictedReadings`` the answer; ``StaticsPhysics`` and
                        ``PyBulletPhysics`` are two
``RULES``               which motor program is next: ``Rule``, from ``Situation`` to ``Choice``
``OBJECTIVES``          how badly a model fits: ``Objective``; ``LargestError``, ``RobustMeanError``
``SEARCHES``            what optimises the paper's population: ``Search``;
                        ``DeterministicCrowding``
``Registry``            implementations by name: the class of the four above
``Problem``             what is known and what is to be found, a TOML file
``Genome``              the code between genes and bodies
``Observation``         what a robot observed in one interaction
``EstimatorError``      what can go wrong; the other errors derive from it
======================= =========================================================================

The modules and subpackages, from the top down; each imports only from those below it:

================== ==============================================================================
Name               What is in it
================== ==============================================================================
``cli``            the command line
``api``            what a program calls
``reproduction``   studies of many runs, resumed by the same command: the paper's figures
``report``         a run in numbers, tables, plots and pages, also while it goes on; a body as
                   URDF, MJCF or JSON
``evaluation``     how good a run is: beside the true body (objective error), and on fresh motor
                   programs (prediction error)
``use``            what an identified body is good for: poses on demand; has it changed, and how?
``identification`` a run: act, sense, model; the robot, a table or a recorded run that it acts on.
                   Two methods: ``posterior_method`` and, with its search and objectives, ``paper``
``exploration``    which motor program is next: the rules
``preloaded``      what worker processes load before they are forked
``workplaces``     where a run's work is done
``posterior``      every body that explains the readings, as samples with weights
``storage``        a run on disk: settings, interactions, generations, posteriors
``problem``        what is known and what is to be found; genes to bodies
``parameters``     what of a robot may be otherwise than its problem says: one table
``physics``        what a body's sensors read at rest: back-ends by name
``readings``       what was observed and what is predicted; the modalities
``body``           a body as a tree of parts, and its kinematics
``executors``      processes and threads here
``cluster``        workers elsewhere
``plugins``        implementations by name
``versions``       what computed a run
``randomness``     the streams that a run's seed gives
``errors``         what can go wrong
================== ==============================================================================

Only ``evaluation`` and ``reproduction`` look at a true body (``evaluation.truth``);
nothing that searches can.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
