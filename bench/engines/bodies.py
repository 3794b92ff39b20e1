"""Random bodies and motor programs, each from a seed of its own."""

from __future__ import annotations

import zlib
from functools import cache
from typing import Final

import numpy as np

from estimator.body.morphology import Morphology
from estimator.physics.base import Pair
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from protocol.wire.capabilities import Capabilities
from robot.service.daemon import describe
from sim_robot.simulator.pc104_set import configure
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels

PROBLEMS: Final = ("parametric", "topological", "topological-20", "topological-24")
NUDGE: Final = np.radians(0.1)
"""How far off a target may be for a reading to count, rad."""


@cache
def _prepared(name: str) -> tuple[Problem, Genome, Capabilities]:
    """A problem written out for the default body's robot."""
    body = load_body(default_body_path())
    capabilities = describe(configure(body, port="", levels=NoiseLevels()))
    problem = Problem.load(name).for_robot(capabilities)
    return problem, Genome(problem, problem.base(capabilities)), capabilities


def draw(name: str, seed: int, number: int) -> tuple[Morphology, Pair, Pair]:
    """Body ``number`` of a problem: genes and motor program uniform in their ranges.

    Args:
        name: Of the problem.
        seed: Of the comparison.
        number: Which body; it does not depend on how many others are drawn.

    Returns:
        The body; it with its motor program; and it with each target 0.1° off, to either side.
    """
    problem, genome, capabilities = _prepared(name)
    rng = np.random.default_rng([seed, zlib.crc32(name.encode()), number])
    body = genome.decode(rng.random(genome.size))
    program = problem.random_program(rng, capabilities)
    nudged = program + NUDGE * rng.choice([-1.0, 1.0], len(program)) * (program != 0)
    return body, (body, program), (body, nudged)
