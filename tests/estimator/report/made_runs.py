"""Runs that were never made: every shape of a run directory, in no time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation
from estimator.storage.posteriors import (
    PredictedInteraction,
    StoredMode,
    StoredPosterior,
    UnexplainedInteraction,
)
from estimator.storage.records import Counters, Generation
from estimator.storage.run_config import RunSettings
from estimator.storage.store import RunStore
from protocol.wire.capabilities import Capabilities, Joint
from tests.estimator.model_robot import make_capabilities

INTERACTIONS = 3
HIPS = ("left", "front", "right", "back")
EIGHT = (*(f"hip_{side}" for side in HIPS), *(f"knee_{side}" for side in HIPS))


def capabilities_with(joints: tuple[str, ...] = EIGHT, robot: str = "model") -> Capabilities:
    """Those of the model robot, with these joints."""
    return replace(
        make_capabilities(),
        robot=robot,
        part_radii=(0.006,) * len(joints),
        joints=tuple(
            Joint(name=name, lower=-1.0, upper=1.0, speed=1.0472, resolution=0.01)
            for name in joints
        ),
    )


def made_run(
    directory: Path,
    problem: str,
    method: Literal["paper", "posterior"],
    *,
    capabilities: Capabilities | None = None,
    complete: bool = True,
    explained: bool = True,
    seed: int = 1,
) -> Path:
    """A run with random models, after three interactions with random readings.

    Args:
        directory: The run directory.
        problem: Name of a shipped problem, or the text of another.
        method: What made it.
        capabilities: The robot's; default: one with hips and knees.
        complete: Whether it is.
        explained: Whether its readings are, by the method posterior.
        seed: Of all that is random.
    """
    rng = np.random.default_rng(seed)
    robot = capabilities or capabilities_with()
    asked = (
        Problem.parse(problem, "test") if "\n" in problem else Problem.load(problem)
    ).for_robot(robot)
    settings = RunSettings(
        explore="random",
        search="deterministic-crowding",
        objective="largest",
        reference="pybullet",
        robot="tcp://127.0.0.1:5750",
        problem=asked.name,
        problem_text=asked.source,
        method=method,
        physics="statics",
        modalities=("touch", "tilt", "clearance"),
        seed=seed,
        interactions=INTERACTIONS if complete else INTERACTIONS + 2,
        population=4,
        generations=1,
    )
    size = Genome(asked, asked.base(robot)).size
    with RunStore.create(directory, settings, robot, "me") as store:
        for number in range(INTERACTIONS):
            program = tuple(asked.random_program(rng, robot).tolist())
            store.plan(number, program, reason=f"tells <b>{number}</b> apart", bits=2.5)
            store.observe(number, _felt(program, rng))
            if method == "paper":
                _save_generations(store, number, rng.random((4, size)))
            else:
                last = complete and number == INTERACTIONS - 1
                stored = _posterior(rng, size, number + 1, simulated=8 * last, explained=explained)
                store.save_posterior(number, stored, Counters(simulations_run=10), None)
        if method == "paper" and complete:
            store.search_end.save_best_fit(None)
    return directory


def _felt(program: tuple[float, ...], rng: np.random.Generator) -> Observation:
    left, ahead = rng.uniform(-0.3, 0.3, 2).tolist()
    return Observation(
        angles=program, touch=(True, False, True, None), tilt=(left, ahead), clearance=0.04
    )


def _save_generations(store: RunStore, iteration: int, population: np.ndarray) -> None:
    for half in range(2):
        generation = Generation(
            number=2 * iteration + half,
            iteration=iteration,
            errors=(3.0, 2.0, 1.0, 4.0),
            best=tuple(population[2].tolist()),
            counters=Counters(simulations_run=10),
        )
        store.save(generation, {"population": population.tolist()})


def _posterior(
    rng: np.random.Generator, size: int, interactions: int, *, simulated: int, explained: bool
) -> StoredPosterior:
    shares, modes = (0.6, 0.2, 0.15, 0.05), rng.random((4, size)).tolist()
    outliers = range(0 if explained else min(2, interactions))
    return StoredPosterior(
        genes=tuple(map(tuple, rng.random((8, size)).tolist())),
        scales=((0.0, 0.1),) * 8,
        weights=(0.125,) * 8,
        best=tuple(modes[0]),
        modes=tuple(
            StoredMode(
                probability=share,
                ess=50.0,
                genes=tuple(genes),
                indistinguishable=False,
                found=(True, True),
            )
            for share, genes in zip(shares, modes, strict=True)
        ),
        probability_within_problem=0.6,
        information_gain_bits=1.5,
        predicted=(
            PredictedInteraction(
                touch=(True,) * 4,
                tilt=(0.1, -0.1),
                clearance=0.05,
                residuals={"touch": 1.0, "tilt": 2.0},
                outlier_probability=0.01,
            ),
        )
        * interactions,
        unexplained=tuple(
            UnexplainedInteraction(interaction=number, sensors=("tilt",)) for number in outliers
        ),
        noisy=(),
        simulated=simulated,
        ess=6.0 if simulated else None,
    )
