"""Genomes: gene arrays in [0, 1] that encode bodies.

A genome goes through the problem's parts in order. Each part contributes one gene for each thing
that is to be found about it, in the order of the paper's rows: parent P, side O, hinge J, length.
A gene that stands for a choice among k is scaled to the integers 0 to k − 1; row i chooses its
parent among the main body and the i − 1 earlier parts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from estimator.errors import SearchStateError
from estimator.morphology import BASE, HINGES, SIDES, Array, Base, Morphology, Part
from estimator.problem import PartRule, Problem


@dataclass(frozen=True, kw_only=True)
class Gene:
    """What one gene decides.

    Attributes:
        part: Index of the part.
        trait: Which of the part's traits.
        name: For people.
    """

    part: int
    trait: Literal["parent", "side", "hinge", "length"]
    name: str


class Genome:
    """The code between gene arrays and bodies, for one problem on one robot.

    Args:
        problem: What is known and what is to be found.
        base: The robot's main body.

    Attributes:
        genes: What each gene decides.
    """

    def __init__(self, problem: Problem, base: Base) -> None:
        self._problem = problem
        self._base = base
        self.genes: tuple[Gene, ...] = tuple(
            gene for index, rule in enumerate(problem.parts) for gene in _genes(index, rule)
        )

    @property
    def size(self) -> int:
        """Number of genes."""
        return len(self.genes)

    def decode(self, genes: Array) -> Morphology:
        """The body that a genome encodes.

        Args:
            genes: Shape (size,), each in [0, 1].

        Raises:
            SearchStateError: The shape is wrong or a gene lies outside [0, 1].
        """
        values = np.asarray(genes, dtype=float)
        if values.shape != (self.size,):
            raise SearchStateError(f"a genome has {self.size} genes, not shape {values.shape}")
        if not np.all((values >= 0) & (values <= 1)):
            raise SearchStateError("every gene must lie in 0 to 1")
        remaining = iter(values.tolist())
        parts = []
        for index, rule in enumerate(self._problem.parts):
            parent = BASE + _choose(remaining, index + 1) if rule.parent is None else rule.parent
            side = _choose(remaining, len(SIDES)) if rule.side is None else rule.side
            hinge = _choose(remaining, len(HINGES)) if rule.hinge is None else rule.hinge
            low, high = rule.length
            length = low + next(remaining) * (high - low) if rule.length_unknown else low
            parts.append(
                Part(
                    parent=parent,
                    side=side,
                    hinge=hinge,
                    length=length,
                    radius=rule.radius,
                    motor=rule.motor,
                    sensor=rule.sensor,
                )
            )
        return Morphology(base=self._base, parts=tuple(parts), density=self._problem.density)

    def decode_all(self, genes: Array) -> list[Morphology]:
        """The bodies that the rows of an array of shape (n, size) encode."""
        return [self.decode(row) for row in genes]


def _genes(index: int, rule: PartRule) -> list[Gene]:
    found = []
    if rule.parent is None:
        found.append(Gene(part=index, trait="parent", name=f"parent of {rule.name}"))
    if rule.side is None:
        found.append(Gene(part=index, trait="side", name=f"side of {rule.name}"))
    if rule.hinge is None:
        found.append(Gene(part=index, trait="hinge", name=f"hinge of {rule.name}"))
    if rule.length_unknown:
        found.append(Gene(part=index, trait="length", name=f"length of {rule.name}"))
    return found


def _choose(values: Iterator[float], count: int) -> int:
    return min(int(next(values) * count), count - 1)
