"""Starts ``sim-robotd``, or another daemon, as a user would, and measures it; for tests, too."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from statistics import median

import psutil

from protocol.transport.client import RobotClient


class Simulator:
    """A running ``sim-robotd``, or another daemon that logs where it serves.

    Args:
        options: Options on the command line.
        bind: Address to which it is told to bind.
        module: Module of the daemon.
        environment: Environment variables on top of ours.

    Attributes:
        process: Process of the daemon, to be measured.
        uri: Address where it takes requests.
        control: Address where faults can be injected; empty if that was not asked for.
        log: Lines that it wrote to standard error so far.
    """

    def __init__(
        self,
        *options: str,
        bind: str = "tcp://127.0.0.1:*",
        module: str = "sim_robot",
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, "--bind", bind, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, **(environment or {})},
        )
        self.process = psutil.Process(self._process.pid)
        self.log: list[str] = []
        self.control = ""
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self.log.append(line)
            if match := re.search(r"injected at (\S+)", line):
                self.control = match[1]
            if match := re.search(r"serving .*? on (tcp://[^\s,]+)", line):
                self.uri = match[1]
                # Somebody must read on, or the daemon blocks once the pipe is full.
                self._reader = threading.Thread(target=self._read_on, daemon=True)
                self._reader.start()
                return
        self._process.communicate()
        raise AssertionError("the daemon did not start: " + "".join(self.log))

    def _read_on(self) -> None:
        assert self._process.stderr is not None
        self.log.extend(self._process.stderr)

    def send(self, number: signal.Signals) -> None:
        """Sends a signal."""
        self._process.send_signal(number)

    def kill(self) -> None:
        """Ends the daemon by SIGKILL, as a power cut would."""
        self._process.kill()
        self._end(timeout=120)

    def terminate(self, timeout: float = 120) -> tuple[int, str]:
        """Ends it by SIGTERM, as a service manager does; returns exit code and standard output."""
        self._process.terminate()
        return self._end(timeout)

    def _end(self, timeout: float) -> tuple[int, str]:
        code = self._process.wait(timeout)
        self._reader.join(timeout)
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        output = "" if self._process.stdout.closed else self._process.stdout.read()
        self._process.stdout.close()
        self._process.stderr.close()
        return code, output


@contextmanager
def helper(module: str, *options: str) -> Iterator[subprocess.Popen[str]]:
    """A module of ours as a process with pipes to and from it, which is ended afterwards."""
    process = subprocess.Popen(
        [sys.executable, "-m", module, *options],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=30)


def cpu_seconds(process: psutil.Process) -> float:
    """CPU time that a process has used so far, s."""
    times = process.cpu_times()
    return times.user + times.system


def cpu_share(process: psutil.Process, seconds: float) -> float:
    """Share of one core that a process uses for so long, %."""
    used_before, start = cpu_seconds(process), time.monotonic()
    time.sleep(seconds)
    return 100 * (cpu_seconds(process) - used_before) / (time.monotonic() - start)


@contextmanager
def simulator(
    *options: str,
    bind: str = "tcp://127.0.0.1:*",
    module: str = "sim_robot",
    environment: Mapping[str, str] | None = None,
) -> Iterator[Simulator]:
    """A ``sim-robotd`` that is killed afterwards; arguments as in ``Simulator``."""
    simulator = Simulator(*options, bind=bind, module=module, environment=environment)
    try:
        yield simulator
    finally:
        simulator.kill()


PROBES = 100  # round trips in one measurement of latency


@dataclass(frozen=True, kw_only=True)
class Sample:
    """Resource use of the daemon at one moment.

    Attributes:
        hours: Virtual time, h.
        memory: Resident memory, MB.
        descriptors: Number of open file descriptors.
        threads: Number of running threads.
        latency: Median round trip of a heartbeat, ms.
        worst: 99th percentile of the round trips, ms.
    """

    hours: float
    memory: float
    descriptors: int
    threads: int
    latency: float
    worst: float


def take_sample(process: psutil.Process, client: RobotClient, hours: float) -> Sample:
    """Measures a daemon through one of its clients."""
    trips = []
    for _ in range(PROBES):
        start = time.perf_counter()
        client.status()
        trips.append(1000 * (time.perf_counter() - start))
    trips.sort()
    return Sample(
        hours=hours,
        memory=process.memory_info().rss / 1e6,
        descriptors=process.num_fds(),
        threads=process.num_threads(),
        latency=median(trips),
        worst=trips[int(0.99 * len(trips))],
    )
