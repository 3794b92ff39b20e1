"""Physics back-ends by name, and where each of them runs.

Another package adds a back-end by an entry point in the group ``bodyschema.physics``: a class that
implements ``Physics`` and declares in its attribute ``abilities`` what else it can do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any, Final, TypeAlias

from estimator.errors import EstimatorError
from estimator.executors import ThisProcess, WorkerProcesses
from estimator.physics.base import Abilities, ArrayPhysics, Physics, WorldSettings
from estimator.physics.pool import PhysicsPool
from estimator.physics.statics import StaticsPhysics
from estimator.plugins import Registry

OpenPhysics: TypeAlias = Callable[[str, WorldSettings], Physics]
"""Makes the back-end of a given name for a given world."""


@dataclass(frozen=True, kw_only=True)
class Computers:
    """Where a run's work is done; its result does not depend on it.

    Attributes:
        open_physics: Makes back-ends there.
        workers: Does other work.
        threads: How many this process may use.
    """

    open_physics: OpenPhysics
    workers: Executor
    threads: int = 1


REFERENCE: Final = "mujoco" if find_spec("pybullet") is None else "pybullet"
"""The back-end that has the last word on models, whatever searched for them: PyBullet where it is
installed. A run records which it is."""

BACKENDS: Final[Registry[Any]] = Registry(
    kind="physics",
    group="bodyschema.physics",
    own=MappingProxyType(
        {
            "pybullet": "estimator.physics.pybullet:PyBulletPhysics",
            "mujoco": "estimator.physics.mujoco:MuJoCoPhysics",
            "statics": "estimator.physics.statics:StaticsPhysics",
        }
    ),
)

_METHODS: Final = (("arrays", "read_bodies"), ("path_margins", "path_margins"))


def abilities_of(name: str) -> Abilities:
    """Returns what the back-end of a name declares that it can do.

    Raises:
        EstimatorError: There is no such back-end, or it cannot be used.
    """
    abilities: Abilities = _load(name).abilities
    return abilities


def maker(name: str, settings: WorldSettings) -> partial[Physics]:
    """Returns a picklable function that makes a back-end in the process that calls it.

    Raises:
        EstimatorError: There is no such back-end, or it cannot be used.
    """
    return partial(_load(name), settings)


def foresight_of(name: str, settings: WorldSettings) -> ArrayPhysics | None:
    """Returns a fast approximation of a back-end; ``None`` if the back-end is as fast itself.

    Raises:
        EstimatorError: There is no such back-end, or it cannot be used.
    """
    return None if abilities_of(name).arrays else StaticsPhysics(settings)


@contextmanager
def on_this_computer(jobs: int) -> Iterator[Computers]:
    """Works on ``jobs`` cores: back-ends in threads if they can, all else in worker processes.

    On one core all is done in this process.

    Raises:
        WorkerError: ``jobs`` is less than 1.
    """
    if jobs == 1:
        yield IN_THIS_PROCESS
        return
    with WorkerProcesses(jobs) as workers:

        def opened(name: str, settings: WorldSettings) -> Physics:
            if abilities_of(name).threads:
                return partial(maker(name, settings), jobs=jobs)()
            return in_workers(name, settings, workers)

        yield Computers(open_physics=opened, workers=workers, threads=jobs)


def on_cluster(cluster: Executor) -> Computers:
    """Works on the workers of a cluster, which stays open."""
    return Computers(open_physics=partial(in_workers, workers=cluster), workers=cluster)


def in_workers(name: str, settings: WorldSettings, workers: Executor) -> Physics:
    """Opens a back-end in workers, which may have other work, too."""
    return PhysicsPool(maker(name, settings), workers, undecided=abilities_of(name).undecided)


def in_this_process(name: str, settings: WorldSettings) -> Physics:
    """Opens a back-end in the calling process."""
    return maker(name, settings)()


IN_THIS_PROCESS: Final = Computers(open_physics=in_this_process, workers=ThisProcess())
"""For callers that are one of many processes."""


def _load(name: str) -> Any:
    back_end = BACKENDS.load(name)
    abilities = getattr(back_end, "abilities", None)
    if not isinstance(abilities, Abilities):
        raise EstimatorError(
            f"the physics {BACKENDS.described(name)} lacks `abilities`, an object of "
            "estimator.physics.base.Abilities that says what it can"
        )
    for ability, method in _METHODS:
        if getattr(abilities, ability) and not hasattr(back_end, method):
            raise EstimatorError(
                f"the physics {BACKENDS.described(name)} declares `{ability}` and has no method "
                f"`{method}`"
            )
    return back_end
