"""Executors on this computer, as ``concurrent.futures`` defines them; ``cluster`` has Dask's.

Tasks depend on nothing but their arguments, so it does not matter which process does a task, or how
often.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from itertools import pairwise
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Final, ParamSpec, TypeVar

from estimator.errors import WorkerError
from estimator.plugins import packages_named_when_failing
from protocol.system.process import Closable, interrupts_deferred

P = ParamSpec("P")
Result = TypeVar("Result")

_PR_SET_PDEATHSIG: Final = 1  # Linux
_LIBC: Final = ctypes.CDLL(None)
_PRELOADED: Final = "estimator.preloaded"
_STARTING: Final = threading.Lock()
_DEATHS: Final = 3
"""Number of processes that may die of one task before it is given up."""


class ThisProcess(Executor):
    """Does each task at once in this process, on copies of its function and arguments."""

    def submit(self, fn: Callable[P, Result], /, *args: P.args, **kwargs: P.kwargs) -> Future[Any]:
        """Calls a function, and returns a future that is done."""
        function, arguments, named = pickle.loads(pickle.dumps((fn, args, kwargs)))
        future: Future[Any] = Future()
        try:
            future.set_result(function(*arguments, **named))
        except Exception as error:
            future.set_exception(error)
        return future


class WorkerProcesses(ThreadPoolExecutor):
    """Processes of this computer, which start with the first tasks and stay for later ones.

    The fork server that starts them has loaded what they need. A thread waits for each of them, so
    one that dies affects no other: a new one does its task. They ignore Ctrl-C in a terminal, which
    is for the process that started them. They end with that process, also when it is killed, and
    discard what engines print. Where a ``with`` block ends by an error or an interrupt they are
    ended, whatever they do. They import the calling program's main module.

    Args:
        jobs: Maximum number of processes.

    Raises:
        WorkerError: ``jobs`` is less than 1. Raised by a task: several processes died of it.
    """

    def __init__(self, jobs: int) -> None:
        if jobs < 1:
            raise WorkerError(f"jobs must be at least 1, not {jobs}")
        super().__init__(jobs, thread_name_prefix="worker")
        _start_fork_server()  # which loads, while others do something else
        self._context = multiprocessing.get_context("forkserver")  # forking threads is unsafe
        self._lifeline, self._ours = self._context.Pipe(duplex=False)
        self._of_thread = threading.local()
        self._pools: list[ProcessPoolExecutor] = []

    def submit(
        self, fn: Callable[P, Result], /, *args: P.args, **kwargs: P.kwargs
    ) -> Future[Result]:
        """Has some process call a function; it, its arguments and its result must be picklable.

        An interrupt is deferred until the task is submitted: within, it may leave a lock taken that
        each thread waits for.
        """
        with interrupts_deferred():
            return super().submit(self._elsewhere, partial(fn, *args, **kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Ends the processes once all tasks are done; may be called twice."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        for pool in self._pools:
            pool.shutdown(wait)
        self._ours.close()
        self._lifeline.close()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Ends the processes: after their tasks, or at once if nobody wants the results."""
        if kind is not None:
            self._ours.close()
        self.shutdown(cancel_futures=kind is not None)

    def _elsewhere(self, work: Callable[[], Result]) -> Result:
        """Has a task done by this thread's process, and by a new one if that dies of it."""
        for _ in range(_DEATHS):
            try:
                return self._pool().submit(_portably, work).result()
            except BrokenProcessPool:
                del self._of_thread.pool
            if self._ours.closed:
                break
        raise WorkerError(
            f"{_DEATHS} worker processes died of the same work, perhaps for lack of memory: free "
            "some, or use fewer --jobs"
        )

    def _pool(self) -> ProcessPoolExecutor:
        """Pool of the one process that belongs to this thread."""
        existing: ProcessPoolExecutor | None = getattr(self._of_thread, "pool", None)
        if existing is not None:
            return existing
        _start_fork_server()  # anew, if it has died
        pool = ProcessPoolExecutor(
            1, mp_context=self._context, initializer=_begin, initargs=(self._lifeline,)
        )
        self._of_thread.pool = pool
        self._pools.append(pool)
        return pool


class Threads(Closable):
    """Threads that share out rows of arrays, for compiled functions that release the interpreter.

    A context manager, which ends the threads. New work starts new ones.

    Args:
        jobs: Number of threads, at least 1.
    """

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._executor: ThreadPoolExecutor | None = None

    def share_out(
        self, function: Callable[[int, int], Result], count: int, *, fewest: int
    ) -> list[Result]:
        """Calls a function with the start and the end of each thread's rows.

        Args:
            function: Works on its rows as if there were no others.
            count: Number of rows.
            fewest: Smallest number of rows that is worth waking a thread for.

        Returns:
            The results, in the order of the rows.
        """
        pieces = min(self._jobs, max(1, count // fewest))
        if pieces == 1:
            return [function(0, count)]
        if self._executor is None:
            self._executor = ThreadPoolExecutor(self._jobs, thread_name_prefix="rows")
        ends = [count * piece // pieces for piece in range(pieces + 1)]
        with interrupts_deferred():  # as in ``WorkerProcesses.submit``
            work = [self._executor.submit(function, start, end) for start, end in pairwise(ends)]
        return [piece.result() for piece in work]

    def close(self) -> None:
        """Ends the threads; may be called twice."""
        if self._executor is not None:
            self._executor.shutdown()
            self._executor = None


def die_with(parent: int, signal_number: int) -> None:
    """Has the kernel send the calling process a signal when its parent dies; Linux only.

    Ends the process at once if the parent is dead already. For children that a process forks
    itself: the parent of worker processes is the fork server.

    Args:
        parent: Process id of the parent.
        signal_number: The signal.
    """
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal_number)
    if os.getppid() != parent:  # the parent has died already
        os._exit(1)


def _start_fork_server() -> None:
    """Starts the fork server with Ctrl-C blocked, as it is then in the processes that it forks.

    The server finds modules where this process does and nowhere else. Up to Python 3.13 it forgets
    the path that it is told, so the path is in its environment, too.
    """
    paths = {"PYTHONPATH": os.pathsep.join(sys.path), "PYTHONSAFEPATH": "1"}
    with _STARTING:
        environment = {name: os.environ.get(name) for name in paths}
        multiprocessing.set_forkserver_preload(["__main__", _PRELOADED])
        resource_tracker.ensure_running()  # if it started later it would unblock Ctrl-C
        old_mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        os.environ.update(paths)
        try:
            forkserver.ensure_running()
        finally:
            for name, value in environment.items():
                del os.environ[name]
                if value is not None:
                    os.environ[name] = value
            signal.pthread_sigmask(signal.SIG_SETMASK, old_mask)


def _portably(work: Callable[[], Result]) -> Result:
    """Does a task; an error that cannot be sent to another process becomes one with its text."""
    try:
        with packages_named_when_failing():
            return work()
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            raise WorkerError(f"{type(error).__name__}: {error}") from None
        raise


def _begin(lifeline: Connection) -> None:
    """Prepares a worker process: discards standard output, and has it end with its parent."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)
    threading.Thread(target=_follow, args=(lifeline,), name="follow", daemon=True).start()


def _follow(lifeline: Connection) -> None:
    """Ends this process when nobody holds the other end of a pipe any more."""
    lifeline.poll(None)
    os._exit(1)
