"""The quadruped as a point of the cube of ``topological-24``, of which nothing is known."""

from __future__ import annotations

import numpy as np

from estimator.body.morphology import Array
from estimator.problem.genome import Genome
from tests.estimator.exploration.test_few_limbs import genome_of

PROBLEM = "topological-24"
PARTS = 8
SIDES = ("left", "front", "right", "back")
LENGTH = 0.5  # of its range: all parts are about 10 cm long


def quadruped(genome: Genome | None = None) -> Array:
    """A leg of two parts on each side; knees like hips interaction up."""
    genome = genome or genome_of(PROBLEM)
    point = np.full(genome.size, LENGTH)
    for column, gene in enumerate(genome.genes):
        if gene.choices:
            point[column] = _cell(genome, point, column, _word(gene.part, gene.trait))
    return point


def _word(part: int, trait: str) -> str:
    upper = part < len(SIDES)
    return {
        "parent": "main body" if upper else f"part {part + 1 - len(SIDES)}",
        "mount": SIDES[part] if upper else "front",
        "hinge": "up",
    }[trait]


def _cell(genome: Genome, point: Array, column: int, word: str) -> float:
    count = genome.genes[column].choices
    cells = (np.arange(count) + 0.5) / count
    points = np.tile(point, (count, 1))
    points[:, column] = cells
    return float(cells[genome.words(column, points).index(word)])
