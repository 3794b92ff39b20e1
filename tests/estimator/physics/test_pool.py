"""Worker processes: same results however many there are, and whatever happens to them."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

from estimator.body.morphology import Morphology
from estimator.errors import PhysicsError
from estimator.executors import WorkerProcesses
from estimator.physics.backends import PhysicsPool
from estimator.physics.base import Pair, WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.readings.observation import PredictedReadings

MakeBody = Callable[[np.random.Generator], Morphology]
MAKE = partial(PyBulletPhysics, WorldSettings(steps=60))


@pytest.fixture
def pairs(random_tree: MakeBody) -> list[Pair]:
    rng = np.random.default_rng(0)
    return [(random_tree(rng), np.radians(rng.uniform(-30, 30, 8))) for _ in range(21)]


def assert_same(one: PredictedReadings, two: PredictedReadings) -> None:
    for item in fields(PredictedReadings):
        assert np.array_equal(getattr(one, item.name), getattr(two, item.name)), item.name


def test_the_number_of_workers_does_not_show(pairs: list[Pair]) -> None:
    with MAKE() as here:
        expected = here.read(pairs)
        here.read(pairs[:2])
        work = (here.simulations, here.steps)
    for jobs in (1, 3):
        with WorkerProcesses(jobs) as workers, PhysicsPool(MAKE, workers) as pool:
            assert_same(pool.read(pairs), expected)
            assert_same(pool.read(pairs[:2]), expected[:2])
            assert (pool.simulations, pool.steps) == work
            assert len(pool.read([])) == 0


def test_a_dead_worker_costs_time_not_results(pairs: list[Pair]) -> None:
    with WorkerProcesses(2) as workers, PhysicsPool(MAKE, workers) as pool:
        expected = pool.read(pairs)
        victims = active_children()
        assert victims
        for victim in victims:
            victim.kill()
            victim.join()
        assert_same(pool.read(pairs), expected)
        assert pool.simulations == 42


def test_errors_come_back_from_workers(pairs: list[Pair]) -> None:
    with WorkerProcesses(2) as workers, PhysicsPool(MAKE, workers) as pool:
        with pytest.raises(PhysicsError, match="must be finite"):
            pool.read([*pairs[:3], (pairs[3][0], np.full(8, np.nan))])
        assert len(pool.read(pairs[:1])) == 1  # and the pool is still of use


PROGRAM = """
import os
from functools import partial
import numpy as np
from estimator.body.morphology import Base, Morphology
from estimator.executors import WorkerProcesses
from estimator.physics.base import WorldSettings
from estimator.physics.backends import PhysicsPool
from estimator.physics.pybullet import PyBulletPhysics

if __name__ == "__main__":
    body = Morphology(base=Base(size=(0.1, 0.1, 0.1), mass=1.0), parts=(), density=1.0)
    with (
        WorkerProcesses(2) as workers,
        PhysicsPool(partial(PyBulletPhysics, WorldSettings(steps=3000)), workers) as pool,
    ):
        try:
            while True:
                pool.read([(body, np.zeros(0))] * 20)
                print("working", flush=True)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
"""


def run_until_working(path: Path) -> subprocess.Popen[str]:
    path.write_text(PROGRAM, "utf-8")
    root = Path(__file__).parents[3]
    program = subprocess.Popen(
        [sys.executable, str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(root)},
        start_new_session=True,
    )
    assert program.stdout is not None
    assert program.stdout.readline() == "working\n"
    return program


def test_ctrl_c_ends_workers_quietly(tmp_path: Path) -> None:
    """A terminal sends the interrupt to the whole process group."""
    with run_until_working(tmp_path / "program.py") as program:
        os.killpg(program.pid, signal.SIGINT)
        out, err = program.communicate(timeout=120)  # returns when the last process is gone
    assert (out.splitlines()[-1], err, program.returncode) == ("interrupted", "", 0)
