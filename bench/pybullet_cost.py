"""The PyBullet back-end on the topological workload, against the plain loop in the same run.

The plain loop is what one would write first: reset, build, 300 steps, read, one body after the
other in one process. Ours stops at rest, and tries a child first where it will fail, then drops it.
Both are counted in simulations *requested*, which is what a search asks for, per second of CPU.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import TypeVar

import numpy as np

from bench.prior_bodies import on_default_robot
from estimator.executors import WorkerProcesses
from estimator.identification.paper.fit import Modeller
from estimator.identification.paper.objectives import LargestError
from estimator.identification.paper.search import DeterministicCrowding
from estimator.physics.backends import REFERENCE, PhysicsPool, approximation_of
from estimator.physics.base import Pair, Physics, WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation
from estimator.storage.records import Counters

Result = TypeVar("Result")

GENERATIONS = 40  # the paper's, with
FEW = 50  # models: the share of children that win is that of a whole run
POPULATION = 300  # the paper's, for
BRIEF = 2  # generations: batches are as large as in a whole run
INTERACTIONS = 9
PLAIN = 300  # simulations of the plain loop


def workload() -> tuple[Problem, Genome, list[Observation]]:
    """The topological problem, and what one of its bodies feels."""
    problem, genome, capabilities = on_default_robot("topological")
    rng = np.random.default_rng(0)
    truth = genome.decode(rng.random(genome.size))
    programs = [problem.random_program(rng, capabilities) for _ in range(INTERACTIONS)]
    with PyBulletPhysics(WorldSettings(full_steps=True)) as physics:
        felt = physics.read([(truth, program) for program in programs])
    observations = [
        Observation(
            angles=tuple(program.tolist()),
            touch=tuple(bool(bit) for bit in felt.touch[row]),
            tilt=(float(felt.tilt[row, 0]), float(felt.tilt[row, 1])),
            clearance=float(felt.clearance[row]),
        )
        for row, program in enumerate(programs)
    ]
    return problem, genome, observations


def _pairs(genome: Genome, observations: list[Observation], count: int) -> list[Pair]:
    rng = np.random.default_rng(1)
    return [
        (
            genome.decode(rng.random(genome.size)),
            np.array(observations[index % len(observations)].angles),
        )
        for index in range(count)
    ]


def plain_loop() -> float:
    """Simulations per CPU second of the plain loop: a fresh world for every body, all steps."""
    _, genome, observations = workload()
    pairs = _pairs(genome, observations, PLAIN)
    start = time.process_time()
    with PyBulletPhysics(WorldSettings(full_steps=True)) as physics:
        for pair in pairs:
            physics.start_afresh()
            physics.read([pair])
    return PLAIN / (time.process_time() - start)


def search(physics: Physics, population: int, generations: int) -> tuple[int, int]:
    """A small topological search; returns simulations requested and run."""
    problem, genome, observations = workload()
    modeller = Modeller(
        genome,
        physics,
        ("touch", "tilt", "clearance"),
        Counters(),
        objective=LargestError(),
        approximation=approximation_of(REFERENCE, WorldSettings()),
    )
    rng = np.random.default_rng(2)
    crowd = DeterministicCrowding(
        population, genome.size, rng, operators=problem.search.operators()
    )
    for number in range(1, INTERACTIONS + 1):
        modeller.introduce(crowd, observations[:number])
        for _ in range(generations):
            modeller.evolve(crowd, observations[:number])
    counters = modeller.counters(0.0)
    return counters.simulations_requested, counters.simulations_run


def _alone(work: Callable[[], Result]) -> Result:
    """Does the work in a fresh process: PyBullet keeps memory, and the CPU clock is a process's."""
    with WorkerProcesses(1) as workers:
        return workers.submit(work).result()


def _search_here() -> tuple[int, int, float]:
    with PyBulletPhysics() as physics:
        start = time.process_time()
        requested, run = search(physics, FEW, GENERATIONS)
        return requested, run, time.process_time() - start


def _search_in_pool(jobs: int) -> float:
    make = partial(PyBulletPhysics, WorldSettings())
    with WorkerProcesses(jobs) as workers, PhysicsPool(make, workers) as pool:
        pool.read(_pairs(*workload()[1:], 4 * jobs))  # workers start
        start = time.perf_counter()
        search(pool, POPULATION, BRIEF)
        return time.perf_counter() - start


def main() -> None:
    """Prints the ratio to the plain loop, where it comes from, and the efficiency of two cores."""
    plain = _alone(plain_loop)
    requested, run, seconds = _alone(_search_here)
    rate = requested / seconds
    print(f"PyBullet, plain loop: {plain:.0f} simulations per CPU second")
    print(
        f"PyBullet, ours: {rate:.0f} requested simulations per CPU second, "
        f"{rate / plain:.1f} times the plain loop (floor 6, aim 8); "
        f"{requested / run:.2f} requested for each one run"
    )
    one, two = _search_in_pool(1), _search_in_pool(2)
    print(f"PyBullet, two workers: efficiency {one / two / 2:.2f} (floor 0.9)")
