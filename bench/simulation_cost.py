"""What a simulation costs: statics, PyBullet's plain loop, our PyBullet back-end, and MuJoCo.

All rates are per second of CPU of one core, in one run, so that other work on the machine weighs on
all alike. The *plain loop* is what one would write first: reset, build, 300 steps, read, one body
after the other in one process. Our PyBullet back-end stops at rest, and tries a child first where
it will fail, then drops it; its searches are counted in simulations *requested*.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Final, TypeVar

import numpy as np

from bench.engines.runs import draw
from bench.prior_bodies import on_robot
from estimator.body.arrays import Bodies
from estimator.executors import WorkerProcesses
from estimator.identification.paper.fit import Modeller
from estimator.identification.paper.objectives import LargestError
from estimator.identification.paper.search import DeterministicCrowding
from estimator.physics.backends import REFERENCE, PhysicsPool, approximation_of
from estimator.physics.base import ArrayPhysics, Pair, Physics, WorldSettings
from estimator.physics.mujoco import MuJoCoPhysics
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation
from estimator.storage.records import Counters

Result = TypeVar("Result")

KINDS: Final = (("quadruped", "parametric"), ("8-part trees", "topological-24"))
SEED: Final = 7
FLOOR: Final = 600  # times the plain loop, for statics
AIM: Final = 2000

GENERATIONS: Final = 40  # the paper's; with them
FEW: Final = 50  # models, of whose children the same share wins as in a whole run
POPULATION: Final = 300  # the paper's; with it
BRIEF: Final = 2  # generations, whose batches are as large as in a whole run
INTERACTIONS: Final = 9

_COMPUTED: Final = 2000  # bodies for statics
_SIMULATED: Final = 100  # bodies for engines that simulate
_PLAIN: Final = 300  # simulations of the plain loop
_REPEATS: Final = 5
_JOBS: Final = 2


def workload() -> tuple[Problem, Genome, list[Observation]]:
    """The topological problem, its genome, and observations of one of its bodies."""
    problem, genome, capabilities = on_robot("topological")
    rng = np.random.default_rng(0)
    truth = genome.decode(rng.random(genome.size))
    programs = [problem.random_program(rng, capabilities) for _ in range(INTERACTIONS)]
    with PyBulletPhysics(WorldSettings(full_steps=True)) as physics:
        readings = physics.read([(truth, program) for program in programs])
    observations = [
        Observation(
            angles=tuple(program.tolist()),
            touch=tuple(bool(bit) for bit in readings.touch[row]),
            tilt=(float(readings.tilt[row, 0]), float(readings.tilt[row, 1])),
            clearance=float(readings.clearance[row]),
        )
        for row, program in enumerate(programs)
    ]
    return problem, genome, observations


def pairs_of(problem: str, count: int) -> list[Pair]:
    """Random bodies with random motor programs."""
    return [draw(problem, SEED, number)[1] for number in range(count)]


def simulations_per_second(physics: Physics, pairs: list[Pair], *, afresh: bool = False) -> float:
    """Simulations per CPU second of an engine in this process."""
    start = time.process_time()
    if afresh:
        for pair in pairs:
            assert isinstance(physics, PyBulletPhysics)
            physics.start_afresh()
            physics.read([pair])
    else:
        physics.read(pairs)
    return len(pairs) / (time.process_time() - start)


def statics_rate(pairs: list[Pair], *, coarse_step: bool = False) -> float:
    """Poses per CPU second of statics on one core: the best of a few times."""
    bodies = Bodies.of([body for body, _ in pairs])
    programs = np.array([program for _, program in pairs])
    with StaticsPhysics() as physics:
        physics.read_bodies(bodies, programs)  # compiles, or loads what was compiled
        return best_rate(
            lambda: physics.read_bodies(bodies, programs, coarse_step=coarse_step), len(pairs)
        )


def best_rate(work: Callable[[], object], count: int) -> float:
    """Rate per CPU second: the best of a few times, which other work disturbs least."""
    best = math.inf
    for _ in range(_REPEATS):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return count / best


def _pairs(genome: Genome, observations: list[Observation], count: int) -> list[Pair]:
    rng = np.random.default_rng(1)
    return [
        (
            genome.decode(rng.random(genome.size)),
            np.array(observations[index % len(observations)].angles),
        )
        for index in range(count)
    ]


def search(
    physics: Physics,
    population: int,
    generations: int,
    *,
    approximation: ArrayPhysics | None = None,
) -> Counters:
    """A topological search of the paper's kind; returns what it has cost."""
    problem, genome, observations = workload()
    modeller = Modeller(
        genome,
        physics,
        ("touch", "tilt", "clearance"),
        Counters(),
        objective=LargestError(),
        approximation=approximation,
    )
    rng = np.random.default_rng(SEED)
    crowd = DeterministicCrowding(
        population, genome.size, rng, operators=problem.search.operators()
    )
    for number in range(1, INTERACTIONS + 1):
        modeller.introduce(crowd, observations[:number])
        for _ in range(generations):
            modeller.evolve(crowd, observations[:number])
    return modeller.counters(0.0)


def _in_fresh_process(work: Callable[[], Result]) -> Result:
    """Does the work in a fresh process: PyBullet keeps memory, and the CPU clock is a process's."""
    with WorkerProcesses(1) as workers:
        return workers.submit(work).result()


def _plain_rate() -> float:
    pairs = _pairs(*workload()[1:], _PLAIN)
    with PyBulletPhysics(WorldSettings(full_steps=True)) as physics:
        return simulations_per_second(physics, pairs, afresh=True)


def _search_here() -> tuple[int, int, float]:
    with PyBulletPhysics() as physics:
        start = time.process_time()
        cost = search(physics, FEW, GENERATIONS, approximation=_approximation())
        seconds = time.process_time() - start
        return cost.simulations_requested, cost.simulations_run, seconds


def _search_in_pool(jobs: int) -> float:
    make = partial(PyBulletPhysics, WorldSettings())
    with WorkerProcesses(jobs) as workers, PhysicsPool(make, workers) as pool:
        pool.read(_pairs(*workload()[1:], 4 * jobs))  # workers start
        start = time.perf_counter()
        search(pool, POPULATION, BRIEF, approximation=_approximation())
        return time.perf_counter() - start


def _approximation() -> ArrayPhysics | None:
    return approximation_of(REFERENCE, WorldSettings())


def report_search_in_pybullet() -> None:
    """Prints the ratio to the plain loop, where it comes from, and the efficiency of two cores."""
    plain = _in_fresh_process(_plain_rate)
    requested, run, seconds = _in_fresh_process(_search_here)
    rate = requested / seconds
    print(f"PyBullet, plain loop: {plain:.0f} simulations per CPU second")
    print(
        f"PyBullet, ours: {rate:.0f} requested simulations per CPU second, "
        f"{rate / plain:.1f} times the plain loop (floor 6, aim 8); "
        f"{requested / run:.2f} requested for each one run"
    )
    single, double = _search_in_pool(1), _search_in_pool(2)
    print(f"PyBullet, two workers: efficiency {single / double / 2:.2f} (floor 0.9)")


def report_search_with_statics() -> None:
    """Prints what a whole topological search with statics costs."""
    _, genome, observations = workload()
    with StaticsPhysics(jobs=_JOBS) as physics:
        bodies = genome.bodies(np.random.default_rng(SEED).random((1, genome.size)))
        physics.read_bodies(bodies, np.array(observations[0].angles))  # compiles, or loads
        wall, cpu = time.perf_counter(), time.process_time()
        cost = search(physics, POPULATION, GENERATIONS)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    print(
        f"topological search with statics, {POPULATION} models × {GENERATIONS} generations × "
        f"{INTERACTIONS} interactions: {wall:.2f} s on {_JOBS} threads, {cpu:.2f} s of CPU; "
        f"{cost.simulations_requested:,} simulations requested, {cost.simulations_run:,} run"
    )


def report_engines(kind: str, problem: str) -> None:
    """Prints the rates for one kind of body."""
    pairs = pairs_of(problem, _COMPUTED)
    computed = statics_rate(pairs)
    sample = pairs[:_SIMULATED]
    fine = WorldSettings(step=1 / 240, steps=1200)
    with PyBulletPhysics(WorldSettings(full_steps=True)) as physics:
        plain = simulations_per_second(physics, sample, afresh=True)
    with PyBulletPhysics() as physics:
        ours = simulations_per_second(physics, sample)
    with MuJoCoPhysics() as mujoco:
        coarse = simulations_per_second(mujoco, sample)
    with MuJoCoPhysics(fine) as mujoco:
        slow = simulations_per_second(mujoco, sample)
    rows: list[tuple[str, float]] = [
        ("PyBullet, plain loop, 300 × 1/60 s", plain),
        ("PyBullet, our back-end, until it rests", ours),
        ("MuJoCo, our back-end, until it rests", coarse),
        ("MuJoCo, our back-end, 1,200 × 1/240 s", slow),
        ("statics", computed),
        ("statics, coarse step", statics_rate(pairs, coarse_step=True)),
    ]
    print(f"{kind}, one core:")
    for name, rate in rows:
        print(f"  {name:<54} {1e6 / rate:>10.2f} µs {rate / plain:>9.1f} × the plain loop")
    print(f"  statics: {computed / plain:.0f} times the plain loop (floor {FLOOR}, aim {AIM:,})")


def main() -> None:
    """Measures and prints everything, which takes some minutes."""
    report_search_in_pybullet()
    for kind, problem in KINDS:
        report_engines(kind, problem)
    report_search_with_statics()


if __name__ == "__main__":
    main()
