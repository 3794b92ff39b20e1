"""The physics back-ends by name, and the ways to run them. A new back-end gets its row here."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import MappingProxyType
from typing import Final, TypeAlias

from estimator.errors import EstimatorError
from estimator.parallel.cluster import Cluster
from estimator.physics.base import Physics, WorldSettings
from estimator.physics.dask import DaskPhysics
from estimator.physics.pool import MakePhysics, PhysicsPool
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics

OpenPhysics: TypeAlias = Callable[[str, WorldSettings], Physics]
"""Makes the back-end of a given name for a given world."""

REFERENCE: Final = "pybullet"
"""The back-end that has the last word on models, whatever searched for them."""

_BACKENDS: Final = MappingProxyType({REFERENCE: PyBulletPhysics, "statics": StaticsPhysics})
BACKENDS: Final = tuple(_BACKENDS)


def maker(name: str, settings: WorldSettings) -> MakePhysics:
    """Makes a back-end when called, in whatever process it is called; picklable.

    Raises:
        EstimatorError: There is no back-end of this name.
    """
    check_name(name)
    return partial(_BACKENDS[name], settings)


def check_name(name: str) -> None:
    """Refuses what is no back-end.

    Raises:
        EstimatorError: There is no back-end of this name.
    """
    if name not in _BACKENDS:
        raise EstimatorError(f"there is no physics {name!r}: choose {', '.join(BACKENDS)}")


def foresight_of(name: str, settings: WorldSettings) -> StaticsPhysics | None:
    """What guesses the readings of a slower back-end; ``None`` where it would be that back-end."""
    return None if name == "statics" else StaticsPhysics(settings)


def in_processes(jobs: int) -> OpenPhysics:
    """Back-ends on ``jobs`` cores: in worker processes, or in threads where the back-end can."""

    def opened(name: str, settings: WorldSettings) -> Physics:
        if name == "statics":
            return StaticsPhysics(settings, jobs=jobs)
        return PhysicsPool(maker(name, settings), jobs)

    return opened


def on_cluster(cluster: Cluster) -> OpenPhysics:
    """Back-ends on the workers of a cluster."""
    return lambda name, settings: DaskPhysics(maker(name, settings), cluster)


def in_this_process(name: str, settings: WorldSettings) -> Physics:
    """A back-end in the calling process, for those that have processes of their own."""
    return maker(name, settings)()
