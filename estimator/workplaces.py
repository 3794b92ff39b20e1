"""Where a run's work is done: in this process, in others of this computer, or in any executor."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeAlias

from estimator.executors import ThisProcess, WorkerProcesses
from estimator.physics.backends import in_this_process, in_workers, open_arrays, physics_class
from estimator.physics.base import ArrayPhysics, Physics, WorldSettings

OpenPhysics: TypeAlias = Callable[[str, WorldSettings], Physics]
"""Makes the back-end of a given name for a given world."""


@dataclass(frozen=True, kw_only=True)
class Executors:
    """Where a run's work is done; its result does not depend on it.

    Attributes:
        open_physics: Makes back-ends that run there.
        workers: Executor that does all other work.
        threads: Number of threads that this process may use.
    """

    open_physics: OpenPhysics
    workers: Executor
    threads: int = 1


IN_THIS_PROCESS: Final = Executors(open_physics=in_this_process, workers=ThisProcess())
"""Executors for callers that are themselves one of many processes."""


@contextmanager
def on_this_computer(jobs: int) -> Iterator[Executors]:
    """Works on ``jobs`` cores: array back-ends in threads, all else in worker processes.

    On one core all is done in this process.

    Raises:
        WorkerError: ``jobs`` is less than 1.
    """
    if jobs == 1:
        yield IN_THIS_PROCESS
        return
    with WorkerProcesses(jobs) as workers:

        def opened(name: str, settings: WorldSettings) -> Physics:
            if issubclass(physics_class(name), ArrayPhysics):
                return open_arrays(name, settings, jobs=jobs)
            return in_workers(name, settings, workers)

        yield Executors(open_physics=opened, workers=workers, threads=jobs)


def on_workers(workers: Executor) -> Executors:
    """Works in an executor, which stays open: one of the calling program, or a ``Cluster``.

    This process uses one core: for the rule that chooses motor programs, and with the method
    ``posterior`` for the physics.

    Args:
        workers: Its workers are processes, which import what this one does: a task may change its
            arguments, and only one thread can use an engine.
    """
    return Executors(open_physics=partial(in_workers, workers=workers), workers=workers)
