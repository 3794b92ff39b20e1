"""A connection to a Dask cluster.

The scheduler and the workers are started by hand, with Dask's own commands. They must have the same
versions of everything that computes, and the same code of ours, or results would differ from those
of a run without them. This is checked of all when connecting, and of each worker before its work.

Dask is imported only where a cluster is asked for.
"""

from __future__ import annotations

import asyncio
import functools
import hashlib
import importlib
import logging
import pickle
import time
import uuid
import warnings
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, Final, NoReturn, TypeAlias

from estimator.errors import ClusterError, WorkerError
from estimator.plugins import installed_packages
from protocol.system.process import Closable

Future: TypeAlias = Any
"""What will come of some work: a ``distributed.Future``."""

_Versions: TypeAlias = Mapping[str, str | None]

_ANSWER: Final = 3.0  # s
_LOOK: Final = 1.0  # s
_COMPUTING: Final = ("bodyschema", "numpy", "numba", "pybullet", "mujoco")
_COMPARED: Final = ("python", "dask", "distributed", *_COMPUTING)
_CODE: Final = "code of bodyschema"
_PACKAGES: Final = ("estimator", "protocol", "robot", "sim_robot")
_SOURCES: Final = (".py", ".toml", ".urdf")


class Cluster(Closable):
    """A connection to a cluster; use it as a context manager.

    Args:
        address: The scheduler's, such as ``tcp://HOST:8786``.
        patience: How long the cluster may be without any worker, s. One that died needs some
            seconds to be replaced.

    Raises:
        ClusterError: Dask is not installed, no scheduler answers, there is no worker, or the
            scheduler or a worker differs from this computer.
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
            self.close()
            raise
        self._identity = _identity()
        self._peopled = time.monotonic()

    def close(self) -> None:
        """Closes the connection; the cluster drops unfinished work. May be called twice."""
        self._client.close()

    @property
    def workers(self) -> int:
        """Number of workers at present."""
        return len(self._ask(self._client.nthreads))

    def submit(self, name: str, function: Callable[..., Any], *arguments: Any) -> Future:
        """Has a function called on some worker, and on another one if that worker dies.

        Args:
            name: What the work is called on Dask's dashboard.
            function: A function of a module, with no effect but its result.
            arguments: Its arguments; picklable, like its result.
        """
        work = pickle.dumps((function, arguments))  # in bytes, for the scheduler not to look into
        key = f"{name}-{uuid.uuid4().hex}"
        self._peopled = time.monotonic()  # patience begins anew
        return self._ask(
            lambda: self._client.submit(_perform, self._identity, work, key=key, pure=False)
        )

    def wait(self, futures: Collection[Future]) -> list[Future]:
        """Waits until some of the futures are done, and returns those.

        Raises:
            ClusterError: The scheduler is lost, or there was no worker for too long.
        """
        while True:
            over = [future for future in futures if future.done()]
            if over:
                return over
            try:
                self._ask(lambda: self._wait_for_one(futures))
            except TimeoutError:
                self._check_peopled()

    def result(self, future: Future) -> Any:
        """Waits for a future and returns its result.

        Raises:
            ClusterError: The scheduler is lost, there was no worker for too long, or one differs
                from this computer.
            WorkerError: Several workers died of this work.
            BodyschemaError: Whatever the function raised.
        """
        while True:
            self.wait([future])
            if future.status == "error":
                return self._failure(future)
            try:
                return self._ask(lambda: future.result(timeout=_LOOK))
            except TimeoutError:
                self._check_peopled()  # its worker has just died, and it is computed again

    def cancel(self, futures: Collection[Future]) -> None:
        """Cancels work whose results are no longer needed."""
        if futures and self._client.status == "running":
            self._client.cancel(list(futures))

    def _wait_for_one(self, futures: Collection[Future]) -> None:
        with self._client.as_current():
            self._dask.wait(list(futures), timeout=_LOOK, return_when="FIRST_COMPLETED")

    def _failure(self, future: Future) -> NoReturn:
        try:
            future.result()
        except self._dask.KilledWorker as error:
            raise WorkerError(
                f"{error.allowed_failures + 1} workers died of the same work, perhaps for lack of "
                "memory: see what they wrote"
            ) from error
        raise self._lost()  # between two looks

    def _ask(self, question: Callable[[], Any]) -> Any:
        """Calls something of Dask's that needs the scheduler."""
        try:
            return question()
        except TimeoutError:
            raise
        except (OSError, self._dask.CancelledError) as error:
            raise self._lost() from error

    def _lost(self) -> ClusterError:
        return ClusterError(f"The connection to the Dask scheduler at {self._address} was lost.")

    def _look_for_scheduler(self) -> None:
        """A client of Dask's own would take long, and be untidy, about finding none."""
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
                "`dask scheduler`."
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

    def _check_peopled(self) -> None:
        if self._client.status != "running":
            raise self._lost()
        now = time.monotonic()
        if self.workers:
            self._peopled = now
        elif now - self._peopled > self._patience:
            raise self._no_worker()

    def _no_worker(self) -> ClusterError:
        return ClusterError(
            f"The Dask scheduler at {self._address} has no worker: start one with "
            f"`dask worker {self._address} --nthreads 1`."
        )

    def _check_everybody(self) -> None:
        """Compares the scheduler and all workers with this computer."""
        client, scheduler = self._client, f"The Dask scheduler at {self._address}"
        versions = self._ask(lambda: client.get_versions(packages=list(_COMPUTING)))
        known = versions["client"]["packages"]  # first what those can tell who do not know our code
        ours = {name: known[name] for name in _COMPARED if name in known}
        _compare(scheduler, versions["scheduler"]["packages"], ours)
        for address, its in versions["workers"].items():
            _compare(f"Worker {address}", its["packages"], ours)
        for address, threads in self._ask(client.nthreads).items():
            _check_threads(address, threads)
        _compare(scheduler, self._ask(lambda: client.run_on_scheduler(_identity)), _identity())
        for address, its in self._ask(lambda: client.run(_identity)).items():
            _compare(f"Worker {address}", its, _identity())


def still_wanted() -> Callable[[], bool]:
    """Returns a function that says whether the result of the calling task is still wanted."""
    worker = _dask().get_worker()
    key = worker.get_current_task()

    def wanted() -> bool:
        task = worker.state.tasks.get(key)
        return task is not None and task.state == "executing"

    return wanted


def _perform(ours: _Versions, work: bytes) -> Any:
    """What a worker does: it may have joined after everybody was checked."""
    worker = _dask().get_worker()
    _check_threads(worker.address, worker.state.nthreads)
    _compare(f"Worker {worker.address}", _identity(), ours)
    function, arguments = pickle.loads(work)
    return function(*arguments)


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
    """Everything that results could depend on."""
    versions = importlib.import_module("distributed.versions")
    packages = versions.get_versions(packages=_COMPUTING)["packages"]
    return {name: packages[name] for name in _COMPARED} | {_CODE: _code()} | installed_packages()


def _code() -> str:
    """A digest of our source and data files, as installed."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for package in _PACKAGES:
        for path in sorted((root / package).rglob("*")):
            if path.suffix in _SOURCES:
                digest.update(str(path.relative_to(root)).encode() + path.read_bytes())
    return digest.hexdigest()[:12]


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
            f"Dask cannot be imported ({error}): pip install 'bodyschema[cluster]'"
        ) from error
