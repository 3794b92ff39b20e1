"""Finds out a robot's body from what it feels when it moves: a package of bodyschema.

``docs/architecture.md`` has the plan. A program needs no more than the names below, which
``__init__.pyi`` lists; ``docs/api.md`` has an example::

    from estimator import identify

    result = identify("runs/first", robot="tcp://127.0.0.1:5750", problem="topological", seed=1)

Each is imported when it is first asked for, so that ``import estimator`` loads no library.

======================= =========================================================================
Name                    What it is
======================= =========================================================================
``identify``            a run from start to end; ``resume`` sees an interrupted one through
``Result``              a run in numbers; ``Listener`` hears of it while it goes on
``load``                what a run knows of the body: ``FittedPosterior``, with ``Attachment``
``best_programs``       the motor programs that are best by a score of your own
``METHODS``             the methods by name, ``posterior`` and ``paper``, and their defaults
``BACKENDS``            what a body feels at rest: ``Physics``, of which ``StaticsPhysics`` and
                        ``PyBulletPhysics`` are two, ``BackEnd`` is the base class, ``Readings``
                        the answer, and ``Abilities`` what it can do beyond
``RULES``               which motor program is next: ``Rule``, from ``Situation`` to ``Choice``
``OBJECTIVES``          how badly a model fits: ``Objective``; ``LargestError``, ``RobustMeanError``
``SEARCHES``            what optimises the paper's population: ``Search``;
                        ``DeterministicCrowding``
``Registry``            what the four above are
``Problem``             what is known and what is to be found, a TOML file
``Genome``              the code between genes and bodies
``Observation``         what a robot felt in one interaction
``EstimatorError``      what can go wrong; the other errors derive from it
======================= =========================================================================

The rooms, from the top down; a room imports only from those below it:

================== ==============================================================================
Room               What is in it
================== ==============================================================================
``cli``            the command line; beside it ``api``: the same from a program
``reproduction``   the paper's figures
``study``          many runs, done side by side and resumed by the same command
``report``         a run in numbers, tables, plots and pages, also while it goes on; a body as
                   URDF, MJCF or JSON
``evaluation``     how good a run is: beside the true body (objective error), and on fresh motor
                   programs (prediction error)
``identification`` a run: act, sense, model. Two methods: ``posterior_method`` and, with its
                   objectives, ``paper``
``exploration``    which motor program is next: the rules
``posterior``      every body that explains the readings, as samples with weights, and how sure
                   that is
``robot_link``     where readings come from: a robot, a table by hand, a recorded run
``storage``        a run on disk: settings, interactions, generations, posteriors
``problem``        what is known and what is to be found; genes to bodies
``physics``        what a body feels at rest: back-ends by name, in processes or on a cluster
``search``         what optimises a population, ask and tell
``parallel``       executors: processes and threads here, workers of a cluster
``readings``       what was observed; the modalities
``body``           a body as a tree of parts, and its kinematics
================== ==============================================================================

Below them all: ``plugins`` (implementations by name), ``versions`` (what computed a run) and
``errors``. Only ``evaluation`` and ``reproduction`` look at a true body (``evaluation.truth``);
nothing that searches can.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
