"""Does the runs of a study side by side, here or on a Dask cluster; the same command resumes it.

On this computer a run works in its own directory, so that Ctrl-C loses nothing it has written. On a
cluster runs are done in turns: a worker is sent what a run has on disk, takes it further for a
minute, and sends its files back. So no file system is shared, and what a worker has done is on this
computer a minute later: a worker that is lost costs a turn, and so does an interrupt.

Layout of a study's directory::

    DIR/
    ├── study.json           what was asked of all runs, and the sessions in which they were made
    └── runs/NAME/           each run's own files, and
        └── made.json        the commits that made it
"""

from __future__ import annotations

import math
import sqlite3
import tempfile
import time
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import ClassVar, Final, Protocol

from estimator.cluster import Cluster, still_wanted
from estimator.errors import WorkerError
from estimator.executors import WorkerProcesses
from estimator.identification.method import Listener
from estimator.reproduction.ledger import RUNS, Ledger, Session, commits_of, note_commit
from protocol.errors import BodyschemaError
from protocol.system.files import replace_file

TURN: Final = 60.0
"""Least time of a turn that does not end the run, s. Starting a robot anew takes two or three."""
_LOOK_INTERVAL: Final = 5.0  # s, between two looks at how far runs are
_FAILURES: Final = (BodyschemaError, OSError, sqlite3.Error)  # end one run; the others go on


class Run(Protocol):
    """One run of a study: picklable, and the same from start to start of the command."""

    @property
    def name(self) -> str:
        """Name for people, and the run's path among the runs of the study; unique there."""

    @property
    def work(self) -> float:
        """Amount of work of the run, in any unit that all runs of the study share."""

    def do(self, root: Path, listener: Listener) -> None:
        """Begins or resumes the run, and finishes it.

        The file that says that it is finished is written last. The listener ends a turn by an
        exception when it hears of work that is safe on disk.

        Args:
            root: The study's directory.
            listener: Hears what happens.
        """

    def is_finished(self, root: Path) -> bool:
        """Whether all files of the run are there."""

    def work_done(self, root: Path) -> float:
        """Amount of its work that is on disk; 0 where the run would begin anew."""

    def sentence(self, root: Path) -> str:
        """How the run went, in words, once it is finished."""


class BriefRun(ABC):
    """A ``Run`` that is not worth resuming: it leaves one file, and begins anew if broken off."""

    leaves: ClassVar[str]
    """Name of the file that the run leaves."""

    @property
    @abstractmethod
    def name(self) -> str:
        """See ``Run``."""

    @property
    def work(self) -> float:
        """See ``Run``."""
        return 1.0

    @abstractmethod
    def make(self, place: Path) -> None:
        """Does the run in its directory ``place``, and leaves its file there."""

    def file(self, root: Path) -> Path:
        """Path of the file that says that the run is finished."""
        return directory(self, root) / self.leaves

    def do(self, root: Path, listener: Listener) -> None:
        """See ``Run``."""
        self.file(root).parent.mkdir(parents=True, exist_ok=True)
        self.make(self.file(root).parent)

    def is_finished(self, root: Path) -> bool:
        """See ``Run``."""
        return self.file(root).exists()

    def work_done(self, root: Path) -> float:
        """See ``Run``."""
        return 0.0

    def sentence(self, root: Path) -> str:
        """See ``Run``."""
        return "done"


@dataclass(frozen=True, kw_only=True)
class Completed:
    """The outcome of a study.

    Attributes:
        failures: Why runs are not finished, by name of the run.
        sessions: All starts of the command, the present one last.
    """

    failures: Mapping[str, str]
    sessions: tuple[Session, ...]


def complete(
    root: Path,
    runs: Sequence[Run],
    listener: Listener,
    *,
    jobs: int,
    cluster: Cluster | None = None,
    command: str = "",
    asked: Mapping[str, str] | None = None,
    shared: Mapping[str, Callable[[], str]] | None = None,
    turn: float = TURN,
) -> Completed:
    """Does all runs that are not finished, the first ones first.

    Args:
        root: The study's directory; made if it is not there.
        runs: Runs of the study.
        listener: Hears how far the study is, how long the rest will take, and how runs went.
        jobs: Number of runs at a time, where there is no cluster.
        cluster: Cluster that does the runs; ``None``: processes of this computer do.
        command: The command as it was typed.
        asked: What all runs of a directory must have in common, by name.
        shared: Functions that return the content of files that the runs read, by the file's name;
            the files are kept in the study's directory.
        turn: Least time of a turn on a cluster, s.

    Raises:
        RunDirectoryError: The directory cannot be made, another process works on it, or its runs
            were asked for otherwise, or with other shared files.
        ClusterError: The cluster failed. A run of which workers die is only given up.
    """

    def at_once() -> int:
        return jobs if cluster is None else max(1, cluster.workers)

    def start(workers: Executor, run: Run) -> Future[_Turn]:
        if cluster is None:
            return workers.submit(_advance, run, root)
        files = {name: (root / name).read_bytes() for name in shared or ()}
        return workers.submit(_take_turn, run, _packed(directory(run, root), root) | files, turn)

    with Ledger(root, asked or {}, command, at_once()) as ledger:
        for name, content in (shared or {}).items():
            ledger.keep(name, content())
        unfinished = [run for run in runs if not run.is_finished(root)]
        if len(unfinished) < len(runs):
            listener.say(f"{len(runs) - len(unfinished)} of {len(runs)} runs are finished already.")
        progress = Progress(
            listener,
            {run.name: run.work for run in unfinished},
            {run.name: run.work_done(root) for run in unfinished},
        )
        failures: dict[str, str] = {}
        try:
            with WorkerProcesses(jobs) if cluster is None else nullcontext(cluster) as workers:
                for run, failure in _ended(
                    root, unfinished, partial(start, workers), at_once, progress
                ):
                    if failure is not None:
                        failures[run.name] = failure
                    outcome = run.sentence(root) if failure is None else f"failed: {failure}"
                    progress.ended(run.name, outcome)
                    ledger.note()
        except KeyboardInterrupt:
            listener.say("The same command goes on from here.")
            raise
        ledger.note()
        return Completed(failures=failures, sessions=ledger.sessions)


def directory(run: Run, root: Path) -> Path:
    """The directory of a run."""
    return root / RUNS / run.name


def made_by(root: Path, runs: Iterable[Run]) -> str:
    """A sentence that names the commits which made some finished runs."""
    counts = Counter(
        ", then ".join(commits_of(directory(run, root))) or "an unknown commit" for run in runs
    )
    if len(counts) == 1:
        return f"Made at {next(iter(counts))}."
    total = counts.total()
    parts = [f"{count} of {total} runs at {commits}" for commits, count in counts.items()]
    return f"Made: {'; '.join(parts) or 'no run'}."


class Progress:
    """Progress over all runs, by work rather than by number: runs differ a hundredfold.

    Args:
        listener: Hears what happens.
        works: Amount of work of each run, by name.
        done: Amount of work of each run that was done before, by name.
        clock: Returns the time, s.
    """

    def __init__(
        self,
        listener: Listener,
        works: Mapping[str, float],
        done: Mapping[str, float],
        clock: Callable[[], float] = time.monotonic,
    ):
        self._listener = listener
        self._works = works
        self._done = {name: min(done.get(name, 0.0), work) for name, work in works.items()}
        self._ended = 0
        self._before = sum(self._done.values())
        self._clock = clock
        self._started = clock()
        listener.expect(sum(works.values()), self._before)

    def stands(self, name: str, done: float) -> None:
        """Notes how much of a run's work is done by now."""
        newly_done = min(done, self._works[name]) - self._done[name]
        if newly_done > 0:
            self._done[name] += newly_done
            self._listener.worked(newly_done, f"{self._ended}/{len(self._works)} runs, {name}")

    def ended(self, name: str, sentence: str) -> None:
        """Notes that a run is over; the sentence says how it went."""
        self._ended += 1
        self.stands(name, math.inf)
        remaining = self.seconds_left()
        remaining_note = f"; {in_words(remaining)} left" if remaining else ""
        self._listener.say(f"{self._ended}/{len(self._works)} {name}: {sentence}{remaining_note}")

    def said(self, name: str, sentence: str) -> None:
        """Passes on a sentence of a run."""
        self._listener.say(f"{name}: {sentence}")

    def seconds_left(self) -> float | None:
        """Time that the rest will take at the pace so far, s; ``None`` while there is no pace."""
        done, elapsed = sum(self._done.values()), self._clock() - self._started
        if done <= self._before or elapsed <= 0:
            return None
        return (sum(self._works.values()) - done) * elapsed / (done - self._before)


def in_words(seconds: float) -> str:
    """A time in words, no more exact than it is known."""
    if seconds < 90:
        return f"about {max(1, round(seconds))} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"about {minutes} min"
    return f"about {minutes // 60} h {minutes % 60:02d} min"


@dataclass(frozen=True, kw_only=True)
class _Turn:
    """The outcome of a turn.

    Attributes:
        files: Content of the run's files by path below the study's directory, in the order in which
            they were written.
        over: Whether its time was up; else there is nothing left to do.
        said: What a person should know.
        failure: Why the run cannot go on.
    """

    files: Mapping[str, bytes] = field(default_factory=dict)
    over: bool = False
    said: tuple[str, ...] = ()
    failure: str | None = None


def _ended(
    root: Path,
    runs: Sequence[Run],
    start: Callable[[Run], Future[_Turn]],
    at_once: Callable[[], int],
    progress: Progress,
) -> Iterator[tuple[Run, str | None]]:
    """Does runs; yields each run that has ended, and why it failed, or ``None``."""
    waiting = deque(runs)
    running: dict[Future[_Turn], Run] = {}
    try:
        while waiting or running:
            while waiting and len(running) < at_once():
                run = waiting.popleft()
                note_commit(directory(run, root), resumed=run.work_done(root) > 0)
                running[start(run)] = run
            done_futures, _ = wait(running, timeout=_LOOK_INTERVAL, return_when=FIRST_COMPLETED)
            for future in done_futures:
                run = running.pop(future)
                try:
                    turn = future.result()
                except WorkerError as error:
                    turn = _Turn(failure=str(error))
                for name, content in turn.files.items():
                    replace_file(root / name, partial(Path.write_bytes, data=content))
                for sentence in turn.said:
                    progress.said(run.name, sentence)
                finished = run.is_finished(root)
                if turn.over and not finished:
                    waiting.appendleft(run)
                    progress.stands(run.name, run.work_done(root))
                else:
                    yield run, None if finished else turn.failure or "not finished"
            for run in running.values():
                progress.stands(run.name, run.work_done(root))
    finally:
        for future in running:
            future.cancel()


def _take_turn(run: Run, files: Mapping[str, bytes], seconds: float) -> _Turn:
    """Takes a run further, on a worker of a cluster."""
    with tempfile.TemporaryDirectory(prefix="study-") as folder:
        root = Path(folder)
        for path, content in files.items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_bytes(content)
        turn = _advance(run, root, seconds, still_wanted())
        return replace(turn, files=_packed(directory(run, root), root))


def _advance(
    run: Run, root: Path, seconds: float = math.inf, wanted: Callable[[], bool] = lambda: True
) -> _Turn:
    """Takes a run further in a directory, to its end or until the time is up."""
    listener, failure, over = _TurnListener(run, root, seconds, wanted), None, False
    try:
        run.do(root, listener)
    except _TurnOver:
        over = True
    except _FAILURES as error:
        failure = str(error)
    return _Turn(over=over, said=tuple(listener.sentences), failure=failure)


class _TurnOver(Exception):  # noqa: N818  not an error
    """The time of a turn is up, or nobody wants its outcome."""


class _TurnListener(Listener):
    """Ends a turn when its time is up, provided that it has taken the run further.

    What a run is doing between two commits to its database would be done again in the next turn,
    for ever if it took longer than a turn.
    """

    def __init__(self, run: Run, root: Path, seconds: float, wanted: Callable[[], bool]):
        self.sentences: list[str] = []
        self._done = partial(run.work_done, root)
        self._end = time.monotonic() + seconds
        self._before = self._done()
        self._wanted = wanted

    def say(self, sentence: str) -> None:
        self.sentences.append(sentence)

    def worked(self, work: float, what: str) -> None:
        is_late = time.monotonic() >= self._end and self._done() > self._before
        if is_late or not self._wanted():
            raise _TurnOver


def _packed(folder: Path, root: Path) -> dict[str, bytes]:
    """Content of a folder's files by path below ``root``, the first written first."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    paths.sort(key=lambda path: path.stat().st_mtime_ns)
    return {str(path.relative_to(root)): path.read_bytes() for path in paths}
