"""Whole runs on a Dask cluster: the same results, whatever becomes of its workers."""

from __future__ import annotations

import _thread
import os
import signal
import threading
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from estimator.cluster import Cluster
from estimator.identification.method import Listener
from estimator.report.evaluations import TRUTH
from estimator.reproduction.harness import complete
from estimator.reproduction.paper_runs import Budget, PlannedRun, typical_runs
from estimator.reproduction.robot_process import print_body
from tests.estimator.dask_cluster import Dask, Process, robots
from tests.estimator.test_cluster import content, estimator

SMALL = Budget(interactions=1, population=4, generations=1)
RUN = typical_runs(SMALL)[0]


class Hearing(Listener):
    def __init__(self) -> None:
        self.work: list[float] = []

    def worked(self, work: float, what: str) -> None:
        self.work.append(work)


@pytest.fixture(scope="module")
def truth() -> str:
    return print_body()


@pytest.fixture(scope="module")
def done_here(tmp_path_factory: pytest.TempPathFactory, truth: str) -> Path:
    root = tmp_path_factory.mktemp("here")
    (root / TRUTH).write_text(truth)
    RUN.do(root, Listener())
    return RUN.directory(root)


def when_robots_run(
    workers: list[Process], act: Callable[[psutil.Process], object]
) -> threading.Thread:
    """Does something, in a thread, with the first robot that a worker starts."""

    def watch() -> None:
        while True:
            for worker in workers:
                for robot in robots(worker.pid):
                    act(robot)
                    return
            assert not workers[0].ends_within(0.05)

    thread = threading.Thread(target=watch)
    thread.start()
    return thread


def test_an_interrupt_ends_runs_and_their_robots(
    tmp_path: Path, two_workers: list[Process], connected: Cluster, truth: str
) -> None:
    budget = Budget(population=20, generations=1000)
    long = PlannedRun(problem=RUN.problem, variant=RUN.variant, seed=1, budget=budget)
    left: list[psutil.Process] = []

    def interrupt(robot: psutil.Process) -> None:
        left.append(robot)
        _thread.interrupt_main()

    watch = when_robots_run(two_workers, interrupt)
    with pytest.raises(KeyboardInterrupt):
        complete(
            tmp_path, [long], Listener(), jobs=1, cluster=connected, shared={TRUTH: lambda: truth}
        )
    watch.join()
    assert psutil.wait_procs(left, timeout=120)[1] == []


def test_a_figure_from_runs_on_a_cluster(
    tmp_path: Path, cluster: Dask, two_workers: list[Process], done_here: Path
) -> None:
    reproduced = estimator(
        *("reproduce", "fig2", "--interactions", "1", "--population", "4", "--generations", "1"),
        *("--dask", cluster.address, "--out", tmp_path),
    )
    assert reproduced.exit_code == 0, reproduced.output
    assert (tmp_path / "fig2.png").stat().st_size > 0
    assert content(RUN.directory(tmp_path)) == content(done_here)


def test_a_run_in_turns_whose_worker_is_killed_ends_as_it_would_have(
    tmp_path: Path, two_workers: list[Process], connected: Cluster, truth: str, done_here: Path
) -> None:
    orphans: list[psutil.Process] = []

    def kill(robot: psutil.Process) -> None:
        orphans.append(robot)
        os.kill(robot.ppid(), signal.SIGKILL)

    hearing, shared = Hearing(), {TRUTH: lambda: truth}
    watch = when_robots_run(two_workers, kill)
    completed = complete(
        tmp_path, [RUN], hearing, jobs=1, cluster=connected, shared=shared, turn=0.0
    )
    watch.join()
    assert not completed.failures
    assert hearing.work == [4, 4]
    assert content(RUN.directory(tmp_path)) == content(done_here)
    for name in ("score.json", "readings.csv"):
        here, there = done_here / name, RUN.directory(tmp_path) / name
        assert there.read_text() == here.read_text()
    assert psutil.wait_procs(orphans, timeout=120)[1] == []
