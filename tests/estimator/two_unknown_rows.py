"""A small problem whose posterior can be computed without any sampler, and what a robot felt."""

from __future__ import annotations

from concurrent.futures import Executor

import numpy as np

from estimator.body.morphology import Array, Base
from estimator.executors import ThisProcess
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.noise import Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.posterior import Mode, Posterior
from estimator.posterior.sampling.sampler import Effort, Sampler
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation

MODALITIES = ("touch", "tilt", "clearance")
CAP = 0.2
LITTLE = Effort(levels=4, chains_per_level=16, steps=30, rounds=1, particles=60, samples=64)
QUICK = Effort(levels=4, chains_per_level=8, steps=10, rounds=1, particles=20, samples=64)
NOISE = Noise(tilt=0.0065, clearance=0.0013)
POINT = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
TWO_UNKNOWN_ROWS = """
name = "two rows"
description = "Two legs of which nothing is known, beside two that are known."
density = 1000.0
motors = { driven = [1, 2, 3, 4], range_deg = [-30.0, 30.0], slew_deg_per_s = 60.0 }
search = { population = 8, generations = 2, interactions = 2 }

[[parts]]
name = "leg 1"
parent = 0
mount = "unknown"
hinge = "unknown"
length = [0.02, 0.40]
radius = 0.006
motor = 1
sensor = 1

[[parts]]
name = "leg 2"
parent = "unknown"
mount = "unknown"
hinge = "unknown"
length = [0.02, 0.40]
radius = 0.006
motor = 2
sensor = 2
""" + "".join(
    f"""
[[parts]]
name = "leg {number}"
parent = 0
mount = "{side}"
hinge = "up"
length = 0.2
radius = 0.006
motor = {number}
sensor = {number}
"""
    for number, side in ((3, "right"), (4, "back"))
)


def make_predictor(length: str) -> Predictor:
    """Predicts for the problem, with that for the length of the unknown legs."""
    text = TWO_UNKNOWN_ROWS.replace("[0.02, 0.40]", length)
    problem = Problem.parse(text, "two rows")
    genome = Genome(problem, Base(size=(0.14, 0.14, 0.085), mass=1.0))
    return Predictor(Unknowns(genome), StaticsPhysics())


def make_sampler(
    predictor: Predictor,
    *,
    effort: Effort = LITTLE,
    seed: int = 1,
    workers: Executor | None = None,
) -> Sampler:
    """Samples the problem's posterior, in this process if no workers are given."""
    seeds = np.random.SeedSequence(seed).spawn(effort.populations + 1)
    return Sampler(
        predictor.unknowns, StaticsPhysics, effort, seeds, workers=workers or ThisProcess()
    )


def draw(
    predictor: Predictor,
    point: Array,
    programs: Array,
    rng: np.random.Generator,
    *,
    scales: tuple[float, float] | Array = (0.0, 0.0),
    outlier: float = NOISE.outlier,
    noise: Noise = NOISE,
) -> SensorData:
    """Readings from the model's own likelihood, outliers and wrong bits included."""
    wide = np.exp(np.asarray(scales))
    readings = predictor.read_all(point[None], programs)
    observations = []
    for row, program in enumerate(programs):
        tilt = readings.tilt[row] + rng.normal(0, noise.tilt * wide[0], 2)
        height = min(readings.clearance[row] + rng.normal(0, noise.clearance * wide[1]), CAP)
        doubtful = readings.touch_doubtful[row]
        wrong = rng.random(doubtful.size) < np.where(doubtful, 0.5, noise.touch)
        touch = readings.touch[row] != wrong
        if rng.random() < outlier or readings.undecided[row]:
            tilt = rng.uniform(-np.pi / 2, np.pi / 2, 2)
            height = CAP if rng.random() < 0.1 else float(rng.uniform(0, CAP))
            touch = rng.random(touch.size) < 0.5
        observations.append(
            Observation(
                angles=tuple(program.tolist()),
                touch=tuple(bool(bit) for bit in touch),
                tilt=(float(tilt[0]), float(tilt[1])),
                clearance=float(height),
                clearance_saturated=bool(height >= CAP),
            )
        )
    return SensorData.of(observations, MODALITIES, CAP)


def programs(count: int, seed: int = 0) -> Array:
    return np.radians(np.random.default_rng(seed).uniform(-30, 30, (count, 4)))


def equally_likely(
    values: Array, best: Array, scales: tuple[float, float] = (0.0, 0.0)
) -> Posterior:
    """A posterior that is sure of one set of attachments, with these samples, shape (n, size)."""
    count = len(values)
    return Posterior(
        values=values,
        scales=np.tile(scales, (count, 1)),
        weights=np.full(count, 1 / count),
        modes=(Mode((), 1.0, best, float(count), (True, True)),),
        adequate_fit=True,
    )
