"""Finds out a robot's body from what it feels when it moves. ``docs/architecture.md`` has the plan.

A program needs no more than the names below; ``docs/api.md`` has an example::

    from estimator import identify

    result = identify("runs/first", robot="tcp://127.0.0.1:5750", problem="topological", seed=1)

Each is imported when it is first asked for, so that ``import estimator`` loads no library.

======================= =========================================================================
Name                    What it is
======================= =========================================================================
``identify``            a run from start to end; ``resume`` sees an interrupted one through
``Result``              a run in numbers; ``Listener`` hears of it while it goes on
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
``live``           a page in the browser that follows a run
``report``         a run in numbers, tables and plots
``evaluation``     how good a run is: beside the true body (objective error), and on fresh motor
                   programs (prediction error)
``identification`` a run: act, sense, model. Two methods: ``posterior_method`` and
                   ``paper_method``; the objectives
``exploration``    which motor program is next: the rules
``posterior``      every body that explains the readings, as samples with weights, and how sure
                   that is
``robot_link``     where readings come from: a robot, a table by hand, a recorded run
``storage``        a run on disk: settings, interactions, generations, beliefs
``export``         a body as URDF, MJCF or JSON
``problem``        what is known and what is to be found; genes to bodies
``physics``        what a body feels at rest: back-ends by name, in processes or on a cluster
``search``         what optimises a population, ask and tell
``parallel``       worker processes, and workers on a cluster
``readings``       what was observed; the modalities
``body``           a body as a tree of parts, and its kinematics
================== ==============================================================================

Below them all: ``plugins`` (implementations by name), ``versions`` (what computed a run) and
``errors``. Only ``evaluation`` and ``reproduction`` look at a true body (``evaluation.truth``);
nothing that searches can.
"""

from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from estimator.api import identify, resume
    from estimator.errors import EstimatorError, SearchStateError
    from estimator.exploration.rules import RULES, Rule
    from estimator.exploration.situation import Choice, Models, Objective, Situation
    from estimator.identification.listener import Listener
    from estimator.identification.objectives import (
        OBJECTIVES,
        LargestError,
        RobustMeanError,
    )
    from estimator.identification.run import METHODS, Order
    from estimator.physics.backends import BACKENDS
    from estimator.physics.base import (
        Abilities,
        ArrayMarginPhysics,
        BackEnd,
        Pair,
        Physics,
        Readings,
        WorldSettings,
    )
    from estimator.physics.pybullet import PyBulletPhysics
    from estimator.physics.statics import StaticsPhysics
    from estimator.plugins import Registry
    from estimator.problem.genome import Genome
    from estimator.problem.problem import Problem
    from estimator.readings.observation import Observation, ObservedReadings
    from estimator.report.result import Result
    from estimator.search.deterministic_crowding import DeterministicCrowding
    from estimator.search.operators import Operators
    from estimator.search.searches import SEARCHES, Search
else:

    def __getattr__(name: str) -> object:
        """Imports a public name when it is first asked for (PEP 562)."""
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
        globals()[name] = value
        return value


__all__ = [
    "BACKENDS",
    "METHODS",
    "OBJECTIVES",
    "RULES",
    "SEARCHES",
    "Abilities",
    "ArrayMarginPhysics",
    "BackEnd",
    "Choice",
    "DeterministicCrowding",
    "EstimatorError",
    "Genome",
    "LargestError",
    "Listener",
    "Models",
    "Objective",
    "Observation",
    "ObservedReadings",
    "Operators",
    "Order",
    "Pair",
    "Physics",
    "Problem",
    "PyBulletPhysics",
    "Readings",
    "Registry",
    "Result",
    "RobustMeanError",
    "Rule",
    "Search",
    "SearchStateError",
    "Situation",
    "StaticsPhysics",
    "WorldSettings",
    "identify",
    "resume",
]

_MODULES: Final = MappingProxyType(
    {
        "identify": "api",
        "resume": "api",
        "EstimatorError": "errors",
        "SearchStateError": "errors",
        "RULES": "exploration.rules",
        "Rule": "exploration.rules",
        "Choice": "exploration.situation",
        "Models": "exploration.situation",
        "Situation": "exploration.situation",
        "Listener": "identification.listener",
        "OBJECTIVES": "identification.objectives",
        "LargestError": "identification.objectives",
        "Objective": "exploration.situation",
        "RobustMeanError": "identification.objectives",
        "METHODS": "identification.run",
        "Order": "identification.run",
        "BACKENDS": "physics.backends",
        "Abilities": "physics.base",
        "ArrayMarginPhysics": "physics.base",
        "BackEnd": "physics.base",
        "Pair": "physics.base",
        "Physics": "physics.base",
        "Readings": "physics.base",
        "WorldSettings": "physics.base",
        "PyBulletPhysics": "physics.pybullet",
        "StaticsPhysics": "physics.statics",
        "Registry": "plugins",
        "Genome": "problem.genome",
        "Problem": "problem.problem",
        "Observation": "readings.observation",
        "ObservedReadings": "readings.observation",
        "Result": "report.result",
        "DeterministicCrowding": "search.deterministic_crowding",
        "Operators": "search.operators",
        "SEARCHES": "search.searches",
        "Search": "search.searches",
    }
)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
