"""The workers of a Dask cluster, as an executor.

The scheduler and the workers are started by hand, with Dask's own commands. They must have the same
versions of everything that computes, and the same code of ours, or results would differ from those
of a run without them. This is checked of all when connecting, and of each worker before its work.

Dask is imported only where a cluster is asked for.
"""

from __future__ import annotations

import asyncio
import functools
import importlib
import logging
import pickle
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor, Future, InvalidStateError
from contextlib import suppress
from functools import partial
from typing import Any, Final, ParamSpec, TypeAlias, TypeVar

from estimator.errors import ClusterError, WorkerError
from estimator.plugins import installed_packages, packages_named_when_failing
from estimator.versions import code_digest
from protocol.system.missing_library import install_command
from protocol.system.process import interrupts_deferred

P = ParamSpec("P")
Result = TypeVar("Result")

_Versions: TypeAlias = Mapping[str, str | None]

_ANSWER: Final = 3.0  # s that a scheduler may take to answer; not tuned
_LOOK: Final = 1.0  # s between two looks at the workers; not tuned
_COMPUTING: Final = ("bodyschema", "numpy", "numba", "pybullet", "mujoco")
_COMPARED: Final = ("python", "dask", "distributed", *_COMPUTING)
_CODE: Final = "code of bodyschema"


class Cluster(Executor):
    """Has tasks done by the workers of a Dask cluster, and again by others if those die.

    A connection to its scheduler; closed at the end of a ``with`` block, or by ``shutdown``. Tasks
    are functions of modules, without any effect but their results, which are picklable.

    Args:
        address: Address of the scheduler, such as ``tcp://HOST:8786``.
        patience: How long the cluster may be without any worker, s. One that died needs some
            seconds to be replaced.

    Raises:
        ClusterError: Dask is not installed, no scheduler answers, there is no worker, or the
            scheduler or a worker differs from this computer. Raised by a task: the scheduler is
            lost, or there was no worker for too long.
        WorkerError: Raised by a task: several workers died of it.
    """

    def __init__(self, address: str, *, patience: float = 60.0):
        self._address = address
        self._patience = patience
        self._dask = _dask()
        _silence()
        self._look_for_scheduler()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a table of versions; we compare them ourselves
            self._client = self._dask.Client(address, timeout=_ANSWER, set_as_default=False)
        try:
            self._look_for_workers()
            self._check_everybody()
        except BaseException:
            self._client.close()
            raise
        self._executor = self._client.get_executor(pure=False)
        self._identity = _identity()
        self._outstanding: set[Future[Any]] = set()
        self._closed = threading.Event()
        self._watch = threading.Thread(target=self._look_after_workers, name="workers", daemon=True)
        self._watch.start()

    @property
    def workers(self) -> int:
        """Number of workers at present."""
        return len(self._ask(self._client.nthreads))

    def submit(self, fn: Callable[P, Result], /, *args: P.args, **kwargs: P.kwargs) -> Future[Any]:
        """Has some worker call a function; returns a future of its result."""
        work = pickle.dumps(partial(fn, *args, **kwargs))  # so the scheduler sees bytes only
        future: Future[Any] = Future()
        inner = self._ask(lambda: self._executor.submit(_perform, self._identity, work))
        future.add_done_callback(lambda done: done.cancelled() and inner.cancel())
        self._outstanding.add(future)
        inner.add_done_callback(partial(self._settle, future))
        return future

    def map(
        self,
        fn: Callable[..., Result],
        *iterables: Iterable[Any],
        timeout: float | None = None,
        chunksize: int = 1,
    ) -> Iterator[Result]:
        """Has workers call a function with each of the arguments; see ``Executor.map``.

        An interrupt is deferred until all tasks are submitted, and cancels what is outstanding.
        """
        try:
            with interrupts_deferred():
                return super().map(fn, *iterables, timeout=timeout, chunksize=chunksize)
        except KeyboardInterrupt:
            for future in list(self._outstanding):
                future.cancel()
            raise

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Closes the connection; the cluster drops unfinished work. May be called twice."""
        self._closed.set()
        self._client.close()
        self._watch.join()

    def _settle(self, future: Future[Any], inner: Future[Any]) -> None:
        """Passes a task's result or error, once ``inner`` has it, on to ``future``."""
        self._outstanding.discard(future)
        error = self._lost() if inner.cancelled() else inner.exception()
        if isinstance(error, self._dask.KilledWorker):
            error = WorkerError(
                f"{error.allowed_failures + 1} workers died of the same work, perhaps for lack of "
                "memory: see what they wrote"
            )
        with suppress(InvalidStateError):  # it was cancelled, or given up
            if error is None:
                future.set_result(inner.result())
            else:
                future.set_exception(error)

    def _look_after_workers(self) -> None:
        """Gives tasks up when the scheduler is lost, or there was no worker for too long."""
        peopled = time.monotonic()
        while not self._closed.wait(_LOOK):
            if self._client.status != "running":
                self._give_up(self._lost())
                continue
            with suppress(ClusterError, TimeoutError):  # the scheduler is being lost, or busy
                if not self._outstanding or self.workers:
                    peopled = time.monotonic()
                elif time.monotonic() - peopled > self._patience:
                    self._give_up(self._no_worker())

    def _give_up(self, error: ClusterError) -> None:
        for future in list(self._outstanding):
            self._outstanding.discard(future)
            with suppress(InvalidStateError):
                future.set_exception(error)

    def _ask(self, question: Callable[[], Any]) -> Any:
        """Calls a function of Dask that needs the scheduler; raises if the connection is lost."""
        try:
            return question()
        except TimeoutError:
            raise
        except Exception as error:  # a client that has closed raises whatever its state makes of it
            is_lost = isinstance(error, OSError | self._dask.CancelledError)
            if is_lost or self._client.status != "running":
                raise self._lost() from error
            raise

    def _lost(self) -> ClusterError:
        return ClusterError(f"The connection to the Dask scheduler at {self._address} was lost.")

    def _look_for_scheduler(self) -> None:
        """Checks that a Dask scheduler answers; Dask's client fails slowly and untidily."""
        try:
            server = asyncio.run(_who_answers(self._dask, self._address))
        except (ValueError, TypeError) as error:
            raise ClusterError(
                f"{self._address!r} is no address of a Dask scheduler ({error}): write "
                "tcp://HOST:8786"
            ) from error
        except Exception as error:  # whatever comes of bytes that are not Dask's
            raise ClusterError(
                f"No Dask scheduler answers at {self._address}: start one there with "
                f"`dask scheduler --host {self._address}`."
            ) from error
        if server != "Scheduler":
            raise ClusterError(
                f"At {self._address} there is no Dask scheduler, but a {server.lower()}: give the "
                "scheduler's address."
            )

    def _look_for_workers(self) -> None:
        try:
            self._client.wait_for_workers(1, timeout=_ANSWER)
        except TimeoutError:
            raise self._no_worker() from None

    def _no_worker(self) -> ClusterError:
        return ClusterError(
            f"The Dask scheduler at {self._address} has no worker: start one with "
            f"`dask worker {self._address} --nthreads 1`."
        )

    def _check_everybody(self) -> None:
        """Compares the scheduler and all workers with this computer."""
        client, scheduler = self._client, f"The Dask scheduler at {self._address}"
        versions = self._ask(lambda: client.get_versions(packages=list(_COMPUTING)))
        local = versions["client"]["packages"]  # first what those without our code can tell, too
        ours = {name: local[name] for name in _COMPARED if name in local}
        _compare(scheduler, versions["scheduler"]["packages"], ours)
        for address, theirs in versions["workers"].items():
            _compare(f"Worker {address}", theirs["packages"], ours)
        for address, threads in self._ask(client.nthreads).items():
            _check_threads(address, threads)
        _compare(scheduler, self._ask(lambda: client.run_on_scheduler(_identity)), _identity())
        for address, theirs in self._ask(lambda: client.run(_identity)).items():
            _compare(f"Worker {address}", theirs, _identity())


def still_wanted() -> Callable[[], bool]:
    """Returns a function that says whether the result of the calling task is still wanted."""
    worker = _dask().get_worker()
    key = worker.get_current_task()

    def wanted() -> bool:
        task = worker.state.tasks.get(key)
        return task is not None and task.state == "executing"

    return wanted


def _perform(ours: _Versions, work: bytes) -> Any:
    """Checks a worker, which may have joined after all were checked, and does a task in it."""
    worker = _dask().get_worker()
    _check_threads(worker.address, worker.state.nthreads)
    _compare(f"Worker {worker.address}", _identity(), ours)
    with packages_named_when_failing():
        return pickle.loads(work)()


def _check_threads(address: str, threads: int) -> None:
    if threads > 1:
        raise ClusterError(
            f"Worker {address} has {threads} threads, and a physics engine can be used by one "
            f"only: start it with --nthreads 1, and with --nworkers {threads} to use {threads} "
            "cores."
        )


def _compare(who: str, theirs: _Versions, ours: _Versions) -> None:
    differences = [
        f"{name} is {theirs.get(name) or 'missing'} there and {ours[name] or 'missing'} here"
        for name in ours
        if theirs.get(name) != ours[name]
    ]
    if differences:
        raise ClusterError(
            f"{who} is not like this computer: {', '.join(differences)}. Install the same in both "
            "places, and start it anew."
        )


@functools.cache
def _identity() -> _Versions:
    """Versions of everything that results could depend on."""
    versions = importlib.import_module("distributed.versions")
    packages = versions.get_versions(packages=_COMPUTING)["packages"]
    return (
        {name: packages[name] for name in _COMPARED} | {_CODE: code_digest()} | installed_packages()
    )


async def _who_answers(dask: Any, address: str) -> str:
    rpc = dask.rpc(address, timeout=_ANSWER)
    try:
        return str((await asyncio.wait_for(rpc.identity(), _ANSWER))["type"])
    finally:
        await rpc.close_rpc()


def _silence() -> None:
    """Keeps what Dask logs out of our output: what matters is said in sentences."""
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)


def _dask() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise ClusterError(
            f"Dask cannot be imported ({error}): {install_command('cluster')}"
        ) from error
