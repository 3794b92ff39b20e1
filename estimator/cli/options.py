"""Options that several subcommands share."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Final, TypeAlias

import typer

from estimator.cluster import Cluster
from estimator.workplaces import Executors, on_this_computer, on_workers

CORES: Final = len(os.sched_getaffinity(0))
"""Processor cores that this process may use: the default of ``--jobs``."""

Directory: TypeAlias = Annotated[Path, typer.Argument(help="A run directory.", metavar="DIR")]
Robot: TypeAlias = Annotated[
    str, typer.Option(help="tcp://HOST:PORT, file:READINGS.csv or replay:DIR.")
]
Jobs: TypeAlias = Annotated[
    int, typer.Option(min=1, help="Worker processes; the result does not depend on it.")
]
Dask: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--dask",
        metavar="ADDRESS",
        help="Scheduler of a Dask cluster, which does the work in place of --jobs processes here.",
    ),
]
Keys: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Key directory, where the robot asks for keys: robotd keys new makes one.",
    ),
]

Strict: TypeAlias = Annotated[
    bool, typer.Option("--strict", help="Exit code 1 where no body explains the readings.")
]
LiveBind: TypeAlias = Annotated[
    str,
    typer.Option("--live-bind", metavar="HOST:PORT", help="Where the live page is served."),
]
Live: TypeAlias = Annotated[
    bool, typer.Option("--live", help="Show the body in the browser while it is being found.")
]


@contextmanager
def executors(jobs: int, dask: str | None) -> Iterator[Executors]:
    """Opens the executors of a command, as ``--jobs`` and ``--dask`` say.

    Args:
        jobs: Number of processes on this computer, where there is no cluster.
        dask: Address of a cluster's scheduler.
    """
    if dask is None:
        with on_this_computer(jobs) as opened:
            yield opened
    else:
        with Cluster(dask) as cluster:
            yield on_workers(cluster)
