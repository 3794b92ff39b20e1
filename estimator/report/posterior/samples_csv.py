"""``posterior.csv``: the samples of a posterior, one row each.

Columns: ``weight``; then per gene what it stands for (a word, or a quantity); then the factors
on the expected noise of tilt and clearance.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

from estimator.body.morphology import Array
from estimator.posterior.fitted import FittedPosterior
from estimator.problem.genome import Genome


def write(path: Path, fitted: FittedPosterior) -> None:
    """Writes the samples.

    Args:
        path: The file.
        fitted: After the last interaction.
    """
    genome = fitted.genome
    names = [f"{gene.name} ({gene.unit})" if gene.unit else gene.name for gene in genome.genes]
    columns = [_values(genome, column, fitted.samples) for column in range(len(names))]
    samples = zip(fitted.weights.tolist(), *columns, fitted.scales.tolist(), strict=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["weight", *names, "tilt noise factor", "clearance noise factor"])
        for weight, *values, scales in samples:
            rows.writerow(
                [f"{weight:.12g}", *values, *(f"{math.exp(scale):.3f}" for scale in scales)]
            )


def _values(genome: Genome, column: int, genes: Array) -> Sequence[str]:
    if genome.genes[column].choices:
        return genome.words(column, genes)
    return [f"{value:.2f}" for value in genome.quantities(column, genes[:, column]).tolist()]
