"""Resource use of a daemon at one moment."""

from __future__ import annotations

import time
from dataclasses import dataclass
from statistics import median

import psutil

from protocol.transport.client import RobotClient

PROBES = 100  # round trips in one measurement of latency


@dataclass(frozen=True, kw_only=True)
class Sample:
    """Resource use of the daemon at one moment.

    Attributes:
        hours: Virtual time.
        memory: Resident, MB.
        descriptors: Open.
        threads: Running.
        latency: Median round trip of a heartbeat, ms.
        worst: The 99th percentile, ms.
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
