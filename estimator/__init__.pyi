"""The public names, and where each is; loaded when first asked for."""

from .api import identify as identify
from .api import load as load
from .api import resume as resume
from .cluster import Cluster as Cluster
from .errors import EstimatorError as EstimatorError
from .errors import SearchStateError as SearchStateError
from .exploration.best_programs import best_programs as best_programs
from .exploration.rules import RULES as RULES
from .exploration.rules import Choice as Choice
from .exploration.rules import Rule as Rule
from .exploration.rules import Situation as Situation
from .identification.method import Listener as Listener
from .identification.paper.objectives import OBJECTIVES as OBJECTIVES
from .identification.paper.objectives import LargestError as LargestError
from .identification.paper.objectives import Objective as Objective
from .identification.paper.objectives import RobustMeanError as RobustMeanError
from .identification.paper.search import SEARCHES as SEARCHES
from .identification.paper.search import DeterministicCrowding as DeterministicCrowding
from .identification.paper.search import Search as Search
from .identification.run import METHODS as METHODS
from .physics.backends import BACKENDS as BACKENDS
from .physics.base import ArrayPhysics as ArrayPhysics
from .physics.base import Pair as Pair
from .physics.base import Physics as Physics
from .physics.base import WorldSettings as WorldSettings
from .physics.pybullet import PyBulletPhysics as PyBulletPhysics
from .physics.statics import StaticsPhysics as StaticsPhysics
from .plugins import Registry as Registry
from .posterior.fitted import Attachment as Attachment
from .posterior.fitted import FittedPosterior as FittedPosterior
from .problem.genome import Genome as Genome
from .problem.operators import Operators as Operators
from .problem.problem import Problem as Problem
from .readings.observation import Observation as Observation
from .readings.observation import PredictedReadings as PredictedReadings
from .report.result import Result as Result
from .storage.run_config import RunConfig as RunConfig
from .use.pose import Goal as Goal
from .use.pose import Pose as Pose
from .use.pose import find_pose as find_pose
from .workplaces import Executors as Executors
from .workplaces import on_workers as on_workers

__all__: list[str]
