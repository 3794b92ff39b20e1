"""Worker processes on this computer.

A worker does one task after the other and keeps what it has loaded. Each has a pipe of its own, so
that one which dies affects no other; its task is given to a new worker. Workers ignore Ctrl-C in a
terminal, which is for the process that started them, and end with it, also when it is killed.

Workers are forked by a fork server, because forking a process with threads is unsafe.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
import traceback
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Final, Generic, NoReturn, TypeAlias, TypeVar

from estimator.errors import WorkerError
from protocol.system.process import Closable

Task = TypeVar("Task")
Message = TypeVar("Message")
Result = TypeVar("Result")

Work: TypeAlias = Callable[[Task, Callable[[Message], None]], Result]
"""Does a task and returns its result; calls its second argument to send messages meanwhile."""

_DEATHS: Final = 3
"""Workers that may die of one task before it is given up."""


@dataclass(frozen=True)
class Returned(Generic[Result]):
    """The result of a task."""

    result: Result


@dataclass(frozen=True)
class Raised:
    """The error of a task; the worker's traceback is a note on it."""

    error: Exception


class WorkerProcesses(Closable, Generic[Task, Message, Result]):
    """A group of worker processes; a context manager, which ends them.

    Workers start with the first tasks, as many as are needed, or all before, and stay for later
    ones. They are daemonic: they cannot start ``multiprocessing`` processes of their own.

    Args:
        start: Called once in each worker; returns the function that does its tasks. Must be
            picklable, like tasks, messages and results.
        jobs: Maximum number of workers, at least 1.
    """

    def __init__(self, start: Callable[[], Work[Task, Message, Result]], jobs: int):
        self._start = pickle.dumps(start)
        self._jobs = jobs
        self._context = multiprocessing.get_context("forkserver")
        self._processes: dict[Connection, BaseProcess] = {}
        self._busy: dict[Connection, int] = {}

    def start(self) -> None:
        """Starts all workers, without waiting until they can work."""
        while len(self._processes) < self._jobs:
            self._new()

    def close(self) -> None:
        """Ends the workers, also busy ones; may be called twice. New tasks start new workers."""
        for process in self._processes.values():
            process.terminate()
        for connection in list(self._processes):
            self._end(connection)

    def do(
        self, tasks: Sequence[Task]
    ) -> Generator[tuple[int, Message | Returned[Result] | Raised], None, None]:
        """Does tasks, started in the order given, and yields events as they arrive.

        Closing the iterator before its end ends the workers that are busy.

        Args:
            tasks: Each is done once, or again if its worker dies.

        Yields:
            Index of a task, and a message about it, its result or its error: a ``WorkerError`` if
            several workers died of it.
        """
        waiting = deque(range(len(tasks)))
        deaths: Counter[int] = Counter()
        try:
            while waiting or self._busy:
                while waiting and len(self._busy) < self._jobs:
                    self._give(waiting[0], tasks[waiting[0]])
                    waiting.popleft()
                for ready in wait(list(self._busy)):
                    assert isinstance(ready, Connection)
                    index = self._busy[ready]
                    try:
                        event = ready.recv()
                    except (EOFError, OSError):
                        self._end(ready)
                        deaths[index] += 1
                        if deaths[index] < _DEATHS:
                            waiting.appendleft(index)
                            continue
                        event = Raised(_given_up())
                    if isinstance(event, Returned | Raised):
                        self._busy.pop(ready, None)
                    yield index, event
        finally:
            for connection in list(self._busy):  # none, unless it was broken off
                self._processes[connection].terminate()
                self._end(connection)

    def results(self, tasks: Sequence[Task]) -> list[Result]:
        """Does tasks and returns their results in order.

        Raises:
            WorkerError: Several workers died of one task.
            Exception: The first error of a task.
        """
        results: dict[int, Result] = {}
        with closing(self.do(tasks)) as events:
            for index, event in events:
                if isinstance(event, Raised):
                    raise event.error
                if isinstance(event, Returned):
                    results[index] = event.result
        return [results[index] for index in range(len(tasks))]

    def _give(self, index: int, task: Task) -> None:
        """Sends a task to an idle worker, or to a new one."""
        for connection in self._processes.keys() - self._busy.keys():
            try:
                connection.send(task)
            except OSError:  # it died while it had nothing to do
                self._end(connection)
            else:
                self._busy[connection] = index
                return
        connection = self._new()
        self._busy[connection] = index
        with suppress(OSError):  # it has died already, which its end of the pipe will say
            connection.send(task)

    def _new(self) -> Connection:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs, self._start), daemon=True)
        with _interrupts_blocked():
            process.start()
            self._processes[ours] = process
        theirs.close()
        return ours

    def _end(self, connection: Connection) -> None:
        """Waits for a worker that is dead or about to die, and forgets it."""
        self._busy.pop(connection, None)
        self._processes.pop(connection).join()
        connection.close()


def _serve(connection: Connection, start: bytes) -> None:
    """The main function of a worker: does tasks until the other end of the pipe is gone."""
    _silence_stdout()
    threading.Thread(target=_follow_parent, name="follow parent", daemon=True).start()
    work: Work[Any, Any, Any]
    try:
        work = pickle.loads(start)()
    except Exception as error:  # raised here it would look like a death
        work = partial(_fail, error)
    event: Returned[Any] | Raised
    with suppress(EOFError, OSError):  # a pipe with unread messages is reset where it is closed
        while True:
            task = connection.recv_bytes()
            try:
                event = Returned(work(pickle.loads(task), connection.send))
            except Exception as error:
                event = Raised(_portable(error))
            connection.send(event)


def _fail(error: Exception, *_: object) -> NoReturn:
    raise error


def _portable(error: Exception) -> Exception:
    """Returns the error, or one with its text if it cannot be sent to another process."""
    error.add_note("".join(["In a worker process:\n", *traceback.format_exception(error)]))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return WorkerError(f"{type(error).__name__}: {error}")
    return error


def _given_up() -> WorkerError:
    return WorkerError(
        f"{_DEATHS} worker processes died of the same work, perhaps for lack of memory: free some, "
        "or use fewer --jobs"
    )


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Blocks Ctrl-C; processes that are started inside inherit that."""
    resource_tracker.ensure_running()  # its own start would unblock them
    kept = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, kept)


def _silence_stdout() -> None:
    """Discards what engines print to stdout."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)


def _follow_parent() -> None:
    """Ends this process when the one that started it through the fork server ends."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
