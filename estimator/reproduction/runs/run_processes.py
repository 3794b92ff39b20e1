"""Runs in parallel, each in a process of its own.

A process that dies costs time: its run is resumed by another.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

from estimator.identification.listener import Listener
from estimator.parallel.worker_processes import Raised, Returned, Work, WorkerProcesses
from estimator.reproduction.runs.plan import PlannedRun
from estimator.reproduction.runs.single_run import complete_run
from protocol.errors import BodyschemaError
from protocol.system.process import Closable

FAILURES: Final = (BodyschemaError, OSError, sqlite3.Error)
"""Errors that end one run and let the others go on."""


@dataclass(frozen=True)
class Worked:
    """Some of a run's work, in simulations, is done."""

    work: float


@dataclass(frozen=True)
class Said:
    """A message for the user."""

    sentence: str


@dataclass(frozen=True)
class Ended:
    """A run is finished, or has failed with a sentence."""

    failure: str | None


News: TypeAlias = Worked | Said | Ended


class Workers(Closable):
    """Processes that do runs; use it as a context manager, which ends them.

    Args:
        jobs: How many runs at a time.
        root: The reproduction's directory.
    """

    def __init__(self, jobs: int, root: Path):
        self._processes: WorkerProcesses[PlannedRun, Worked | Said, None] = WorkerProcesses(
            partial(_start, root), jobs
        )

    def close(self) -> None:
        """Ends them, also busy ones: a run is safe at any instant."""
        self._processes.close()

    def do(self, runs: Sequence[PlannedRun]) -> Iterator[tuple[PlannedRun, News]]:
        """Does runs, in the order given as far as there are processes; yields what happens."""
        for index, event in self._processes.do(runs):
            news: News
            if isinstance(event, Returned):
                news = Ended(None)
            elif isinstance(event, Raised):
                if not isinstance(event.error, FAILURES):
                    raise event.error
                news = Ended(str(event.error))
            else:
                news = event
            yield runs[index], news


class _EventListener(Listener):
    """Sends a run's progress to the process that started it."""

    def __init__(self, tell: Callable[[Worked | Said], None]):
        self._tell = tell

    def say(self, sentence: str) -> None:
        self._tell(Said(sentence))

    def worked(self, work: float, what: str) -> None:
        self._tell(Worked(work))


def _start(root: Path) -> Work[PlannedRun, Worked | Said, None]:
    return lambda run, tell: complete_run(run, root, _EventListener(tell))
