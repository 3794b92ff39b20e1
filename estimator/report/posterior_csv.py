"""``posterior.csv``: the samples of a posterior, one row each.

Columns: ``weight``; then per gene what it stands for (a word, or a length in mm); then the factors
on the announced noise of tilt and clearance.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

from estimator.problem.genome import Genome
from estimator.storage.beliefs import Belief


def write(path: Path, genome: Genome, belief: Belief) -> None:
    """Writes the samples.

    Args:
        path: The file.
        genome: Of the run's problem.
        belief: After its last interaction.
    """
    names = [gene.name if gene.choices else f"{gene.name} (mm)" for gene in genome.genes]
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["weight", *names, "tilt noise factor", "clearance noise factor"])
        for genes, scales, weight in zip(belief.genes, belief.scales, belief.weights, strict=True):
            rows.writerow(
                [
                    f"{weight:.6g}",
                    *(_value(genome, column, gene) for column, gene in enumerate(genes)),
                    *(f"{math.exp(scale):.3f}" for scale in scales),
                ]
            )


def _value(genome: Genome, column: int, gene: float) -> str:
    if genome.genes[column].choices:
        return genome.word(column, genome.choice(column, gene))
    return f"{1000 * genome.length(column, gene):.2f}"
