"""A scheduler and workers of Dask, started by command, as a person would."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import psutil

from estimator.physics.base import Pair, WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.readings.observation import PredictedReadings

ROOT: Final = Path(__file__).parents[2]
_DASK: Final = Path(sys.executable).with_name("dask")
_SCHEDULER: Final = re.compile(r"Scheduler at: +(\S+)")
_WORKER: Final = re.compile(r"Start worker at: +(\S+)")
_QUIET: Final = {  # Dask looks at itself up to a hundred times a second, a thirtieth of a core
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",
    "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "10s",
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
}


class Process:
    """A scheduler or a worker; use it as a context manager.

    Attributes:
        address: Where it listens, once ``wait_until`` said so.
    """

    def __init__(self, folder: Path, *arguments: str, path: Sequence[Path] = ()):
        search = os.pathsep.join(map(str, (*path, ROOT)))
        self._process = subprocess.Popen(
            [str(_DASK), *arguments],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            cwd=folder,
            env=os.environ | _QUIET | {"PYTHONPATH": search},
        )
        self.address = ""
        self._log: list[str] = []
        self._changed = threading.Condition()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def wait_for(self, line: str) -> None:
        """Returns once it has written a line."""
        with self._changed:
            printed = self._changed.wait_for(lambda: line in "".join(self._log), 300)
        assert printed, "".join(self._log)

    def ends_within(self, seconds: float) -> bool:
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        return True

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()
        self._reader.join()

    def _read(self) -> None:
        assert self._process.stderr is not None
        with self._process.stderr as lines:
            for line in lines:
                with self._changed:
                    self._log.append(line)
                    if match := _SCHEDULER.search(line) or _WORKER.search(line):
                        self.address = match[1]
                    self._changed.notify_all()


class Dask:
    """A scheduler with workers; all of them end with the context manager."""

    def __init__(self, folder: Path):
        self._folder = folder
        self._processes = [
            Process(folder, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        ]
        self._processes[0].wait_for("Scheduler at")

    @property
    def address(self) -> str:
        return self._processes[0].address

    @property
    def workers(self) -> list[Process]:
        return [process for process in self._processes[1:] if process.alive]

    def start_worker(self, *, threads: int = 1, path: Sequence[Path] = ()) -> Process:
        worker = Process(
            self._folder,
            *("worker", self.address, "--host", "127.0.0.1", "--nthreads", str(threads)),
            *("--no-nanny", "--no-dashboard", "--local-directory", str(self._folder)),
            path=path,
        )
        self._processes.append(worker)
        return worker

    def have_workers(self, count: int) -> None:
        """Starts as many as are missing, together."""
        for _ in range(count - len(self.workers)):
            self.start_worker()
        for worker in self.workers:
            worker.wait_for("Registered to")

    def kill_scheduler(self) -> None:
        self._processes[0].kill()

    def close(self) -> None:
        for process in reversed(self._processes):
            process.kill()


@contextmanager
def dask(folder: Path) -> Iterator[Dask]:
    cluster = Dask(folder)
    try:
        yield cluster
    finally:
        cluster.close()


class HeldPhysics(PyBulletPhysics):
    """PyBullet that asks, in the middle of its work, whether it may go on."""

    def __init__(self, address: tuple[str, int], settings: WorldSettings):
        super().__init__(settings)
        self._address = address

    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        held(self._address)
        return super().read(pairs)


def held(address: tuple[str, int]) -> None:
    """Returns once the gate at an address lets it go on."""
    with socket.create_connection(address) as gate:
        gate.sendall(f"{os.getpid()}\n".encode())
        gate.recv(1)


@contextmanager
def gate(asked: Callable[[int], object]) -> Iterator[tuple[str, int]]:
    """Where ``held`` asks; it goes on when ``asked``, called with its process, returns."""

    def serve() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            with connection, connection.makefile() as lines:
                if line := lines.readline():
                    asked(int(line))

    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield listener.getsockname()
        finally:
            listener.shutdown(socket.SHUT_RDWR)
            thread.join()


def robots(pid: int) -> list[psutil.Process]:
    """The simulated robots that a worker has started."""
    return psutil.Process(pid).children()


def pretend(folder: Path, versions: Mapping[str, str]) -> Path:
    """A place on the search path from which packages seem to have other versions."""
    for name, version in versions.items():
        place = folder / f"{name}-{version}.dist-info"
        place.mkdir(parents=True)
        (place / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
        )
    return folder
