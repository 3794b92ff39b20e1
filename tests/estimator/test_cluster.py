"""Work on a Dask cluster: the same results, whatever becomes of its workers."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from estimator.body.morphology import Morphology
from estimator.cli.command_line import app
from estimator.cluster import Cluster
from estimator.errors import ClusterError, PhysicsError
from estimator.physics.backends import PhysicsPool
from estimator.physics.base import Pair, WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Predictor
from estimator.readings.observation import PredictedReadings
from estimator.storage.store import RunStore
from protocol.system.missing_library import install_command
from tests.estimator.dask_cluster import (
    ROOT,
    Dask,
    HeldPhysics,
    Process,
    dask,
    gate,
    held,
    pretend,
)
from tests.estimator.model_robot import ModelRobot, make_order, serving
from tests.estimator.physics.test_pool import assert_same
from tests.estimator.two_unknown_rows import NOISE, QUICK, draw, make_sampler, programs
from tests.free_ports import free_address
from tests.waiting import until

MakeBody = Callable[[np.random.Generator], Morphology]
SETTINGS = WorldSettings(steps=60)


@pytest.fixture(scope="module")
def pairs(random_tree: MakeBody) -> list[Pair]:
    rng = np.random.default_rng(0)
    return [(random_tree(rng), np.radians(rng.uniform(-30, 30, 8))) for _ in range(21)]


@pytest.fixture(scope="module")
def expected(pairs: list[Pair]) -> tuple[PredictedReadings, int]:
    with PyBulletPhysics(SETTINGS) as here:
        return here.read(pairs), here.steps


# --- populations ----------------------------------------------------------------------------------


def test_a_cluster_reads_what_this_process_reads(
    connected: Cluster, pairs: list[Pair], expected: tuple[PredictedReadings, int]
) -> None:
    assert connected.workers == 2
    with PhysicsPool(partial(PyBulletPhysics, SETTINGS), connected) as physics:
        assert_same(physics.read(pairs), expected[0])
        assert (physics.simulations, physics.steps) == (21, expected[1])
        with pytest.raises(PhysicsError, match="must be finite"):
            physics.read([*pairs[:3], (pairs[3][0], np.full(8, np.nan))])
        assert_same(physics.read(pairs[:3]), expected[0][:3])
        assert len(physics.read([])) == 0
    other = WorldSettings(
        steps=60, touch_gap=0.05
    )  # the workers' engines are for the settings before
    with (
        PyBulletPhysics(other) as here,
        PhysicsPool(partial(PyBulletPhysics, other), connected) as there,
    ):
        assert_same(there.read(pairs), here.read(pairs))


def test_a_cluster_moves_chains_as_this_process_does(
    connected: Cluster, predictor: Predictor
) -> None:
    point = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
    data = draw(predictor, point, programs(1), np.random.default_rng(2))
    here = make_sampler(predictor, effort=QUICK)
    there = make_sampler(predictor, effort=QUICK, workers=connected)
    likelihood = Likelihood(data, NOISE)
    assert np.array_equal(there.learn(likelihood).values, here.learn(likelihood).values)
    assert there.cost == here.cost
    assert here.cost.simulations > 0


def tasks_left(cluster: Cluster) -> tuple[int, int]:
    """Tasks that the scheduler knows of, and those that the workers do."""
    client = cluster._client
    known = client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks))
    held = client.run(lambda dask_worker: len(dask_worker.state.tasks))
    return known, sum(held.values())


@pytest.fixture
def lost_interrupts_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python loses an interrupt that meets a finaliser, and says so: no error of the test's."""
    others = sys.unraisablehook

    def hook(unraisable: sys.UnraisableHookArgs) -> None:
        if unraisable.exc_type is not KeyboardInterrupt:
            others(unraisable)

    monkeypatch.setattr(sys, "unraisablehook", hook)


@pytest.mark.usefixtures("lost_interrupts_pass")
def test_an_interrupt_cancels_what_is_outstanding(
    connected: Cluster, pairs: list[Pair], expected: tuple[PredictedReadings, int]
) -> None:
    begun: list[int] = []
    interrupted, released = threading.Event(), threading.Event()
    interrupt = partial(signal.pthread_kill, threading.get_ident(), signal.SIGINT)

    def asked(pid: int) -> None:
        begun.append(pid)
        if len(begun) == 1:
            interrupt()
            while not interrupted.wait(60):  # in case one was lost
                interrupt()
        assert released.wait(120)

    with gate(asked) as address:
        held = PhysicsPool(partial(HeldPhysics, address, SETTINGS), connected)
        with pytest.raises(KeyboardInterrupt):
            held.read(pairs)
        interrupted.set()
        while tasks_left(connected) > (0, 2):  # not all have heard yet that they are cancelled
            time.sleep(0.02)
        released.set()
        physics = PhysicsPool(partial(PyBulletPhysics, SETTINGS), connected)
        assert_same(physics.read(pairs), expected[0])
    assert len(begun) <= 2  # of 11 chunks: one on each worker, which could not be stopped


def test_an_interrupt_of_submitting_cancels_what_is_submitted(connected: Cluster) -> None:
    begun, released = threading.Event(), threading.Event()

    def asked(_: int) -> None:
        begun.set()
        released.wait(120)

    def addresses() -> Iterator[tuple[str, int]]:
        yield address
        assert begun.wait(60)
        signal.raise_signal(signal.SIGINT)
        yield address

    with gate(asked) as address:
        try:
            with pytest.raises(KeyboardInterrupt):
                connected.map(held, addresses())
            assert until(lambda: tasks_left(connected)[0] == 0, 30)
        finally:
            released.set()


# --- the command ----------------------------------------------------------------------------------


def estimator(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def content(directory: Path) -> dict[str, Any]:
    """All of a run that must not depend on where it was done."""
    kept: dict[str, Any] = json.loads((directory / "result.json").read_text())
    for name in ("wall_seconds", "robot_uri", "robot", "problem_asked"):
        del kept[name]
    with RunStore.open(directory, to_write=False) as store:
        kept["errors"] = [item.errors for item in store.generations()]
        kept["felt"] = [item.observation for item in store.interactions()]
        predictions = [item for one in store.validations.all() for item in one]
        kept["predictions"] = [(item.program, item.readings) for item in predictions]
        kept["felt"] += [item.observation for item in predictions]
    assert None not in kept["felt"]
    return kept


def test_identify_resume_and_validate_on_a_cluster(
    tmp_path: Path, cluster: Dask, two_workers: list[Process], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("estimator.evaluation.validate.RANDOM_MODELS", 4)
    contents = {}
    for place, where in (("here", ("--jobs", "1")), ("there", ("--dask", cluster.address))):
        out = tmp_path / place
        with serving(ModelRobot()) as uri:
            order = ("--robot", uri, "--problem", make_order(tmp_path, uri).problem, "--seed", "3")
            for command in (
                ("identify", *order, "--method", "paper", "--interactions", "1", "--out", out),
                ("resume", out),
                ("validate", out, "--robot", uri, "--programs", "2"),
            ):
                done = estimator(*command, *where)
                assert done.exit_code == 0, done.output
        contents[place] = content(out), (out / "validation.json").read_text()
    assert contents["there"] == contents["here"]


def test_no_scheduler_is_a_sentence_within_seconds(tmp_path: Path) -> None:
    started = time.monotonic()
    refused = estimator(
        *("identify", "--robot", "bob", "--problem", "parametric", "--dask", free_address()),
        *("--out", tmp_path / "run"),
    )
    assert refused.exit_code == 1
    assert "estimator: No Dask scheduler answers at tcp://127.0.0.1" in refused.stderr
    assert time.monotonic() - started < 25
    assert not (tmp_path / "run").exists()


def test_a_scheduler_that_is_started_as_advised_is_found(tmp_path: Path) -> None:
    address = free_address()
    with pytest.raises(ClusterError) as refused:
        Cluster(address)
    (arguments,) = re.findall(r"`dask (.+)`", str(refused.value))
    scheduler = Process(tmp_path, *arguments.split(), "--no-dashboard")
    try:
        scheduler.wait_for("Scheduler at")
        with pytest.raises(ClusterError, match=f"The Dask scheduler at {address} has no worker"):
            Cluster(address)
    finally:
        scheduler.kill()


def test_dask_may_be_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ClusterError, match=re.escape(install_command("cluster"))):
        Cluster(free_address())


@pytest.mark.parametrize("address", ["bob", "tcp://127.0.0.1", "carrier://pigeon:1"])
def test_a_wrong_address_is_a_sentence(address: str) -> None:
    with pytest.raises(ClusterError, match="is no address of a Dask scheduler"):
        Cluster(address)


def test_another_server_is_no_scheduler(
    two_workers: list[Process], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("estimator.cluster._ANSWER", 1.0)
    with pytest.raises(ClusterError, match="there is no Dask scheduler, but a worker"):
        Cluster(two_workers[0].address)
    with serving(ModelRobot()) as uri, pytest.raises(ClusterError, match="No Dask scheduler"):
        Cluster(uri)


def test_who_is_not_like_us_does_not_work_for_us(
    tmp_path: Path, pairs: list[Pair], monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(
        ROOT / "estimator",
        tmp_path / "old" / "estimator",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    (tmp_path / "old" / "estimator" / "old.py").write_text("# gone since\n")
    with dask(tmp_path) as cluster:
        with monkeypatch.context() as impatient:
            impatient.setattr("estimator.cluster._ANSWER", 1.0)
            with pytest.raises(ClusterError, match="has no worker: start one with `dask worker"):
                Cluster(cluster.address)
        cluster.have_workers(1)
        with Cluster(cluster.address) as early:
            other = cluster.start_worker(path=[pretend(tmp_path / "new", {"pybullet": "3.2.6"})])
            many = cluster.start_worker(threads=2)
            old = cluster.start_worker(path=[tmp_path / "old"])
            cluster.have_workers(4)
            physics = PhysicsPool(partial(PyBulletPhysics, SETTINGS), early)
            with pytest.raises(ClusterError, match=r"Worker tcp://.* (threads|not like this)"):
                physics.read(pairs)
        with pytest.raises(ClusterError, match=r"pybullet is 3\.2\.6 there and .* here"):
            Cluster(cluster.address)
        other.kill()
        with pytest.raises(ClusterError, match=r"has 2 threads.*start it with --nthreads 1"):
            Cluster(cluster.address)
        many.kill()
        with pytest.raises(ClusterError, match=r"code of bodyschema is .* there and"):
            Cluster(cluster.address)
        old.kill()
        Cluster(cluster.address).shutdown()


# --- workers that die: last, since each must be replaced ------------------------------------------


def test_a_worker_killed_in_its_work_costs_time_not_results(
    cluster: Dask, connected: Cluster, pairs: list[Pair], expected: tuple[PredictedReadings, int]
) -> None:
    victims: list[int] = []

    def asked(pid: int) -> None:
        if not victims:
            os.kill(pid, signal.SIGKILL)
            victims.append(pid)

    with gate(asked) as address:
        physics = PhysicsPool(partial(HeldPhysics, address, SETTINGS), connected)
        assert_same(physics.read(pairs), expected[0])
    assert (physics.simulations, physics.steps) == (21, expected[1])
    assert len(victims) == 1
    assert victims[0] not in [worker.pid for worker in cluster.workers]


def test_a_cluster_that_loses_all_workers_is_a_sentence(
    cluster: Dask, connected: Cluster, pairs: list[Pair]
) -> None:
    with gate(lambda pid: os.kill(pid, signal.SIGKILL)) as address:
        physics = PhysicsPool(partial(HeldPhysics, address, SETTINGS), connected)
        with pytest.raises(ClusterError, match="has no worker: start one with `dask worker tcp://"):
            physics.read(pairs)
    assert not cluster.workers


def test_a_scheduler_that_dies_is_a_sentence(
    cluster: Dask, connected: Cluster, pairs: list[Pair]
) -> None:
    with gate(lambda _: cluster.kill_scheduler()) as address:
        physics = PhysicsPool(partial(HeldPhysics, address, SETTINGS), connected)
        with pytest.raises(ClusterError, match=r"connection to the Dask scheduler at .* was lost"):
            physics.read(pairs)


def test_a_scheduler_that_died_while_nothing_was_asked_of_it_is_a_sentence(tmp_path: Path) -> None:
    lost = r"connection to the Dask scheduler at .* was lost"
    with dask(tmp_path) as cluster:
        cluster.have_workers(1)
        with Cluster(cluster.address) as connection:
            cluster.kill_scheduler()
            assert until(lambda: connection._client.status == "closed")
            with pytest.raises(ClusterError, match=lost):
                connection.submit(len, [1])
            with pytest.raises(ClusterError, match=lost):
                _ = connection.workers
