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
``identification`` a run: act, sense, model. Two methods: ``posterior_method`` and, with its
                   objectives, ``paper``
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
    from estimator.api import identify as identify
    from estimator.api import resume as resume
    from estimator.errors import EstimatorError as EstimatorError
    from estimator.errors import SearchStateError as SearchStateError
    from estimator.exploration.rules import RULES as RULES
    from estimator.exploration.rules import Rule as Rule
    from estimator.exploration.situation import Choice as Choice
    from estimator.exploration.situation import Models as Models
    from estimator.exploration.situation import Objective as Objective
    from estimator.exploration.situation import Situation as Situation
    from estimator.identification.listener import Listener as Listener
    from estimator.identification.order import METHODS as METHODS
    from estimator.identification.order import Order as Order
    from estimator.identification.paper.objectives import OBJECTIVES as OBJECTIVES
    from estimator.identification.paper.objectives import LargestError as LargestError
    from estimator.identification.paper.objectives import RobustMeanError as RobustMeanError
    from estimator.physics.backends import BACKENDS as BACKENDS
    from estimator.physics.base import Abilities as Abilities
    from estimator.physics.base import ArrayMarginPhysics as ArrayMarginPhysics
    from estimator.physics.base import BackEnd as BackEnd
    from estimator.physics.base import Pair as Pair
    from estimator.physics.base import Physics as Physics
    from estimator.physics.base import Readings as Readings
    from estimator.physics.base import WorldSettings as WorldSettings
    from estimator.physics.pybullet import PyBulletPhysics as PyBulletPhysics
    from estimator.physics.statics import StaticsPhysics as StaticsPhysics
    from estimator.plugins import Registry as Registry
    from estimator.problem.genome import Genome as Genome
    from estimator.problem.problem import Problem as Problem
    from estimator.readings.observation import Observation as Observation
    from estimator.readings.observation import ObservedReadings as ObservedReadings
    from estimator.report.result import Result as Result
    from estimator.search.deterministic_crowding import (
        DeterministicCrowding as DeterministicCrowding,
    )
    from estimator.search.operators import Operators as Operators
    from estimator.search.searches import SEARCHES as SEARCHES
    from estimator.search.searches import Search as Search
else:

    def __getattr__(name: str) -> object:
        """Imports a public name when it is first asked for (PEP 562)."""
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
        globals()[name] = value
        return value


_NAMES: Final = MappingProxyType(
    {
        "api": ("identify", "resume"),
        "errors": ("EstimatorError", "SearchStateError"),
        "exploration.rules": ("RULES", "Rule"),
        "exploration.situation": ("Choice", "Models", "Situation", "Objective"),
        "identification.listener": ("Listener",),
        "identification.paper.objectives": ("OBJECTIVES", "LargestError", "RobustMeanError"),
        "identification.order": ("METHODS", "Order"),
        "physics.backends": ("BACKENDS",),
        "physics.base": (
            "Abilities",
            "ArrayMarginPhysics",
            "BackEnd",
            "Pair",
            "Physics",
            "Readings",
            "WorldSettings",
        ),
        "physics.pybullet": ("PyBulletPhysics",),
        "physics.statics": ("StaticsPhysics",),
        "plugins": ("Registry",),
        "problem.genome": ("Genome",),
        "problem.problem": ("Problem",),
        "readings.observation": ("Observation", "ObservedReadings"),
        "report.result": ("Result",),
        "search.deterministic_crowding": ("DeterministicCrowding",),
        "search.operators": ("Operators",),
        "search.searches": ("SEARCHES", "Search"),
    }
)
_MODULES: Final = {name: module for module, names in _NAMES.items() for name in names}
__all__ = list(_MODULES)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
