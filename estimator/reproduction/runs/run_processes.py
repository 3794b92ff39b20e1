"""Runs in parallel, each in a process of its own.

A process does one run after the other, so what it has loaded serves them all. One that dies costs
time: its run is resumed by another.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sqlite3
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Final, Self, TypeAlias

from estimator.identification.listener import Listener
from estimator.parallel.child_process import die_with, interrupts_blocked, silence_stdout
from estimator.reproduction.runs.plan import PlannedRun
from estimator.reproduction.runs.single_run import see_through
from protocol.errors import BodyschemaError

_DEATHS: Final = 3
"""Processes that may die of one run before it is given up."""


@dataclass(frozen=True)
class Worked:
    """Some of a run's work, in simulations, is done."""

    work: float


@dataclass(frozen=True)
class Said:
    """Something that a person should know."""

    sentence: str


@dataclass(frozen=True)
class Ended:
    """A run is finished, or has failed with a sentence."""

    failure: str | None


News: TypeAlias = Worked | Said | Ended


class Workers:
    """Processes that do runs; use it as a context manager, which ends them.

    Args:
        jobs: How many runs at a time.
        root: The reproduction's directory.
    """

    def __init__(self, jobs: int, root: Path):
        self._jobs = jobs
        self._root = root
        self._context = multiprocessing.get_context("spawn")
        self._processes: dict[Connection, BaseProcess] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            process.terminate()  # a run is safe at any instant
        for connection, process in self._processes.items():
            process.join()
            connection.close()
        self._processes.clear()

    def do(self, runs: Sequence[PlannedRun]) -> Iterator[tuple[PlannedRun, News]]:
        """Does runs, in the order given as far as there are processes; yields what happens."""
        waiting = deque(runs)
        busy: dict[Connection, PlannedRun] = {}
        idle = [self._start() for _ in range(min(self._jobs, len(runs)))]
        deaths: Counter[PlannedRun] = Counter()
        while waiting or busy:
            while waiting and idle:
                connection, run = idle.pop(), waiting.popleft()
                busy[connection] = run
                connection.send(run)
            for ready in wait(list(busy)):
                assert isinstance(ready, Connection)
                run = busy[ready]
                try:
                    news: News = ready.recv()
                except (EOFError, OSError):
                    del busy[ready]
                    self._bury(ready)
                    idle.append(self._start())
                    deaths[run] += 1
                    if deaths[run] < _DEATHS:
                        waiting.appendleft(run)
                        continue
                    news = Ended(f"{_DEATHS} processes died of it, perhaps for lack of memory")
                if isinstance(news, Ended) and busy.pop(ready, None) is not None:
                    idle.append(ready)
                yield run, news

    def _start(self) -> Connection:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs, self._root, os.getpid()))
        with interrupts_blocked():
            process.start()
        theirs.close()
        self._processes[ours] = process
        return ours

    def _bury(self, connection: Connection) -> None:
        process = self._processes.pop(connection)
        process.join()
        connection.close()


class _Teller(Listener):
    """Passes on what a run's owner wants to know of it."""

    def __init__(self, connection: Connection):
        self._connection = connection

    def say(self, sentence: str) -> None:
        self._connection.send(Said(sentence))

    def worked(self, work: float, what: str) -> None:
        self._connection.send(Worked(work))


def _serve(connection: Connection, root: Path, parent: int) -> None:
    """A process: does the runs that it is sent, until nobody sends any more."""
    silence_stdout()
    die_with(parent, signal.SIGKILL)
    teller = _Teller(connection)
    while True:
        try:
            run: PlannedRun = connection.recv()
        except EOFError:
            return
        failure = None
        try:
            see_through(run, root, teller)
        except (BodyschemaError, OSError, sqlite3.Error) as error:
            failure = str(error)
        connection.send(Ended(failure))
