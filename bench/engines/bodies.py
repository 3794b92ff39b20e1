"""Random bodies and motor programs, each from a seed of its own."""

from __future__ import annotations

import zlib
from typing import Final

import numpy as np

from bench.prior_bodies import drawn_genes, on_default_robot
from estimator.body.morphology import Morphology
from estimator.physics.base import Pair

PROBLEMS: Final = ("parametric", "topological", "topological-20", "topological-24")
NUDGE: Final = np.radians(0.1)
"""How far off a target may be for a reading to count, rad."""


def draw(name: str, seed: int, number: int) -> tuple[Morphology, Pair, Pair]:
    """Body ``number`` of a problem: genes and motor program uniform where they are allowed.

    Args:
        name: Of the problem.
        seed: Of the comparison.
        number: Which body; it does not depend on how many others are drawn.

    Returns:
        The body; it with its motor program; and it with each target 0.1° off, to either side.
    """
    problem, genome, capabilities = on_default_robot(name)
    rng = np.random.default_rng([seed, zlib.crc32(name.encode()), number])
    body = genome.decode(drawn_genes(genome, rng))
    program = problem.random_program(rng, capabilities)
    nudged = program + NUDGE * rng.choice([-1.0, 1.0], len(program)) * (program != 0)
    return body, (body, program), (body, nudged)
