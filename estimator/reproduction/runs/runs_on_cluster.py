"""Runs on a Dask cluster, in turns of about a minute.

A turn gets a run's database, takes the run further on a robot of its own, and returns the database.
So no worker holds anything that is not here a minute later: one that is lost costs a turn, and so
does an interrupt.
"""

from __future__ import annotations

import tempfile
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from estimator.errors import WorkerError
from estimator.identification.listener import Listener
from estimator.parallel.cluster import Cluster, Future, still_wanted
from estimator.report.evaluation_files import SCORE, TRUTH
from estimator.reproduction.runs.plan import PlannedRun
from estimator.reproduction.runs.run_processes import FAILURES, Ended, News, Said, Worked
from estimator.reproduction.runs.single_run import complete_run, has_begun, is_finished, work_done
from estimator.storage.database import DATABASE
from estimator.storage.store import LOCK, RunStore
from protocol.system.files import replace_file
from protocol.system.process import Closable

TURN: Final = 60.0
"""Least time of a turn that does not end the run, s. Starting a robot anew takes two or three."""


@dataclass(frozen=True, kw_only=True)
class _Turn:
    """The outcome of a turn.

    Attributes:
        files: By their path below the run directory: all of them when the run is finished, or
            else the database.
        finished: Whether nothing is left to do.
        said: What a person should know.
        failure: Why the run cannot go on.
    """

    files: Mapping[str, bytes]
    finished: bool
    said: tuple[str, ...]
    failure: str | None


class ClusterWorkers(Closable):
    """Does runs on a cluster; use it as a context manager, which ends them.

    Args:
        cluster: The cluster; stays open.
        root: The reproduction's directory, with the truth in it.
        turn: Least time of a turn, s.
    """

    def __init__(self, cluster: Cluster, root: Path, *, turn: float = TURN):
        self._cluster = cluster
        self._root = root
        self._turn = turn
        self._busy: dict[Future, PlannedRun] = {}

    def close(self) -> None:
        """Cancels what is under way."""
        self._cluster.cancel(self._busy)
        self._busy.clear()

    def do(self, runs: Sequence[PlannedRun]) -> Iterator[tuple[PlannedRun, News]]:
        """Does runs, in the order given as far as there are workers; yields what happens.

        Raises:
            ClusterError: The cluster failed. A run of which workers die is only given up.
        """
        truth = (self._root / TRUTH).read_text("utf-8")
        waiting = deque(runs)
        while waiting or self._busy:
            while waiting and len(self._busy) < max(1, self._cluster.workers):
                run = waiting.popleft()
                database = self._database(run)
                future = self._cluster.submit(
                    run.name, _take_turn, run, truth, database, self._turn
                )
                self._busy[future] = run
            for future in self._cluster.wait(self._busy):
                run = self._busy[future]
                try:
                    turn: _Turn = self._cluster.result(future)
                except WorkerError as error:
                    turn = _Turn(files={}, finished=False, said=(), failure=str(error))
                del self._busy[future]
                before = work_done(run, self._root)
                self._keep(run, turn)
                if not turn.finished and turn.failure is None:
                    waiting.appendleft(run)
                yield run, Worked(work_done(run, self._root) - before)
                for sentence in turn.said:
                    yield run, Said(sentence)
                if turn.finished or turn.failure is not None:
                    yield run, Ended(turn.failure)

    def _database(self, run: PlannedRun) -> bytes | None:
        if not has_begun(run, self._root):  # which also undoes what a crash left half done
            return None
        return (run.directory(self._root) / DATABASE).read_bytes()

    def _keep(self, run: PlannedRun, turn: _Turn) -> None:
        """Puts a turn's files in their place; last the one that says that the run is finished."""
        for name in sorted(turn.files, key=lambda name: name == SCORE):
            write = partial(Path.write_bytes, data=turn.files[name])
            replace_file(run.directory(self._root) / name, write)


class _TurnOver(Exception):  # noqa: N818  not an error
    """The time of a turn is up."""


class _NoLongerWanted(Exception):  # noqa: N818  not an error
    """The run was cancelled."""


class _TurnListener(Listener):
    """Ends a turn when its time is up, provided that it has brought anything.

    What a run is doing between two commits would be done again in the next turn, for ever if it
    took longer than a turn.
    """

    def __init__(self, run: PlannedRun, root: Path, seconds: float):
        self.said: list[str] = []
        self._run = run
        self._root = root
        self._end = time.monotonic() + seconds
        self._before = _committed(run, root)
        self._wanted = still_wanted()

    def say(self, sentence: str) -> None:
        self.said.append(sentence)

    def worked(self, work: float, what: str) -> None:
        if not self._wanted():
            raise _NoLongerWanted
        if time.monotonic() >= self._end and _committed(self._run, self._root) > self._before:
            raise _TurnOver


def _take_turn(run: PlannedRun, truth: str, database: bytes | None, seconds: float) -> _Turn:
    """What a worker does."""
    with tempfile.TemporaryDirectory(prefix="estimator-") as name:
        root = Path(name)
        directory = run.directory(root)
        directory.mkdir(parents=True)
        (root / TRUTH).write_text(truth, encoding="utf-8")
        if database is not None:
            (directory / DATABASE).write_bytes(database)
        clock = _TurnListener(run, root, seconds)
        failure = None
        try:
            complete_run(run, root, clock)
        except _TurnOver:
            pass
        except FAILURES as error:
            failure = str(error)
        finished = is_finished(run, root)
        return _Turn(
            files={
                str(path.relative_to(directory)): path.read_bytes()
                for path in directory.rglob("*")
                if path.is_file() and path.name != LOCK and (finished or path.name == DATABASE)
            },
            finished=finished,
            said=tuple(clock.said),
            failure=failure,
        )


def _committed(run: PlannedRun, root: Path) -> int:
    """How many steps of a run are on disk."""
    if not has_begun(run, root):
        return 0
    with RunStore.open(run.directory(root), to_write=False) as store:
        validations = store.validations.all()
        performed = sum(item.observation is not None for one in validations for item in one)
        return len(store.generations()) + len(validations) + performed
