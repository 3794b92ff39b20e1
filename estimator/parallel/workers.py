"""Where work is shared out: in this process, to processes on this computer, or to a cluster."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final, Protocol, TypeVar

from estimator.errors import WorkerError
from estimator.parallel.cluster import Cluster
from estimator.parallel.worker_processes import Work, WorkerProcesses

Task = TypeVar("Task")
Result = TypeVar("Result")

_TASK: Final = "share"


class Workers(Protocol):
    """Do tasks that depend on nothing but themselves, so it does not matter who does which."""

    @property
    def count(self) -> int:
        """How many there are at present."""

    def prepare(self, load: Callable[[], object]) -> None:
        """Has each worker load what tasks will need, while this process goes on.

        Args:
            load: Picklable; called once in each worker that starts from now on.
        """

    def map(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> list[Result]:
        """Calls a copy of a function once with a copy of each task.

        Args:
            function: Picklable, like tasks and results.
            tasks: Its arguments.

        Returns:
            The results in the order of the tasks.

        Raises:
            WorkerError: Several workers died of the same task.
            Exception: The first error that a task raised.
        """

    def close(self) -> None:
        """Gives processes back; may be called twice."""


class ThisProcess:
    """No workers: tasks are done here, one after the other."""

    count: Final = 1

    def prepare(self, load: Callable[[], object]) -> None:
        """Does nothing: what is needed is loaded when it is."""

    def map(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> list[Result]:
        """See ``Workers``."""
        results = []
        for task in tasks:
            called, copied = pickle.loads(pickle.dumps((function, task)))
            results.append(called(copied))
        return results

    def close(self) -> None:
        """Does nothing."""


class LocalWorkers:
    """Processes on this computer, which start when they are prepared, or with the first tasks.

    Args:
        jobs: Maximum number of processes.

    Attributes:
        count: The same.

    Raises:
        WorkerError: ``jobs`` is less than 1.
    """

    def __init__(self, jobs: int) -> None:
        if jobs < 1:
            raise WorkerError(f"there must be at least one worker process, not {jobs}")
        self.count = jobs
        self._processes: WorkerProcesses[tuple[Callable[..., Any], Any], None, Any] = (
            WorkerProcesses(_start, jobs)
        )

    def prepare(self, load: Callable[[], object]) -> None:
        """See ``Workers``."""
        self._processes.close()
        self._processes = WorkerProcesses(partial(_start, load), self.count)
        self._processes.start()

    def map(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> list[Result]:
        """See ``Workers``."""
        return self._processes.results([(function, task) for task in tasks])

    def close(self) -> None:
        """Ends the processes."""
        self._processes.close()


class DaskWorkers:
    """The workers of a cluster.

    Args:
        cluster: Stays open.
    """

    def __init__(self, cluster: Cluster) -> None:
        self._cluster = cluster

    @property
    def count(self) -> int:
        """See ``Workers``."""
        return self._cluster.workers

    def prepare(self, load: Callable[[], object]) -> None:
        """Does nothing: the workers have other things to do, and come and go."""

    def map(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> list[Result]:
        """See ``Workers``; raises a ``ClusterError`` if the cluster fails."""
        futures = []
        try:
            for task in tasks:
                futures.append(self._cluster.submit(_TASK, function, task))
            return [self._cluster.result(future) for future in futures]
        except BaseException:
            self._cluster.cancel(futures)
            raise

    def close(self) -> None:
        """Does nothing: the workers are the cluster's."""


def _start(
    load: Callable[[], object] | None = None,
) -> Work[tuple[Callable[..., Any], Any], None, Any]:
    if load is not None:
        load()
    return lambda work, _: work[0](work[1])
