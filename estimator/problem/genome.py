"""Genomes: gene arrays in [0, 1] that encode bodies.

A genome goes through the problem's parts in order. Each part contributes one gene for each thing
that is to be found about it, in the order of the paper's rows: parent P, side O, hinge J, length.
A gene that stands for a choice among k is scaled to the integers 0 to k − 1; row i chooses its
parent among the main body and the i − 1 earlier parts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from estimator.body.arrays import Bodies, Integers
from estimator.body.morphology import BASE, HINGES, SIDES, Array, Base, Morphology, Part
from estimator.errors import SearchStateError
from estimator.problem.problem import Problem
from estimator.problem.sections import PartRule


@dataclass(frozen=True, kw_only=True)
class Gene:
    """What one gene decides.

    Attributes:
        part: Index of the part.
        trait: Which of the part's traits.
        choices: How many values it chooses from; 0 for a length, which is any in a range.
        name: For people.
    """

    part: int
    trait: Literal["parent", "side", "hinge", "length"]
    choices: int
    name: str


class Genome:
    """Decodes gene arrays into bodies, for one problem on one robot.

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

    def choice(self, column: int, gene: float) -> int:
        """The choice that a gene between 0 and 1 stands for."""
        choices = self.genes[column].choices
        return min(int(gene * choices), choices - 1)

    def word(self, column: int, choice: int) -> str:
        """What a gene's choice means: the name of a part, a side or a hinge."""
        gene = self.genes[column]
        if gene.trait == "parent":
            return "main body" if choice == 0 else self._problem.parts[choice - 1].name
        return (SIDES if gene.trait == "side" else HINGES)[choice]

    def length(self, column: int, gene: float) -> float:
        """The length, m, that a gene between 0 and 1 stands for."""
        low, high = self._problem.parts[self.genes[column].part].length
        return low + gene * (high - low)

    def decode(self, genes: Array) -> Morphology:
        """Returns the body that a genome encodes.

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
        return self.assemble(parts)

    def assemble(self, parts: Sequence[Part]) -> Morphology:
        """Returns the body that parts make up on this robot, with its touch sensors.

        Args:
            parts: In the order of the problem's rows.
        """
        if self._problem.touch == "outermost":
            parts = _with_outermost_sensors(parts, self._problem.sensors)
        return Morphology(base=self._base, parts=tuple(parts), density=self._problem.density)

    def decode_all(self, genes: Array) -> list[Morphology]:
        """Returns the bodies that the rows of an array of shape (n, size) encode."""
        return [self.decode(row) for row in genes]

    def bodies(self, genes: Array) -> Bodies:
        """Returns the same bodies as arrays, without making an object per body.

        Args:
            genes: Shape (n, size), each in [0, 1].

        Raises:
            SearchStateError: The shape is wrong or a gene lies outside [0, 1].
        """
        values = np.asarray(genes, dtype=float)
        if values.ndim != 2 or values.shape[1] != self.size:
            raise SearchStateError(f"genomes have {self.size} genes, not shape {values.shape}")
        if not np.all((values >= 0) & (values <= 1)):
            raise SearchStateError("every gene must lie in 0 to 1")
        body = Bodies.of([self.decode(np.zeros(self.size))])
        rows = np.zeros(len(values), dtype=np.intp)
        traits = {
            "parent": body.parent[rows],
            "side": body.side[rows],
            "hinge": body.hinge[rows],
        }
        length, sensor = body.length[rows], body.sensor[rows]
        for column, gene in enumerate(self.genes):
            if gene.trait == "length":
                low, high = self._problem.parts[gene.part].length
                length[:, gene.part] = low + values[:, column] * (high - low)
            else:
                chosen = (values[:, column] * gene.choices).astype(np.int64)
                np.minimum(chosen, gene.choices - 1, out=chosen)
                traits[gene.trait][:, gene.part] = chosen + (BASE if gene.trait == "parent" else 0)
        if self._problem.touch == "outermost":
            sensor = _outermost_sensors(traits["parent"], self._problem.sensors)
        return Bodies(
            count=body.count[rows],
            motor=body.motor[rows],
            sensor=sensor,
            length=length,
            radius=body.radius[rows],
            base=body.base[rows],
            **traits,
        )


def _genes(index: int, rule: PartRule) -> list[Gene]:
    traits: tuple[tuple[Literal["parent", "side", "hinge", "length"], bool, int], ...] = (
        ("parent", rule.parent is None, index + 1),
        ("side", rule.side is None, len(SIDES)),
        ("hinge", rule.hinge is None, len(HINGES)),
        ("length", rule.length_unknown, 0),
    )
    return [
        Gene(part=index, trait=trait, choices=choices, name=f"{trait} of {rule.name}")
        for trait, unknown, choices in traits
        if unknown
    ]


def _with_outermost_sensors(parts: Sequence[Part], sensors: int) -> list[Part]:
    carriers = {part.parent for part in parts}
    chosen = sorted(range(len(parts)), key=lambda index: (index in carriers, index))[:sensors]
    numbers = {index: number for number, index in enumerate(sorted(chosen))}
    return [replace(part, sensor=numbers.get(index)) for index, part in enumerate(parts)]


def _outermost_sensors(parent: Integers, sensors: int) -> Integers:
    """The same for n bodies: sensor of each part, or −1, shape (n, parts)."""
    rows, parts = parent.shape
    carriers = np.zeros((rows, parts), dtype=bool)
    body, part = np.nonzero(parent >= 0)
    carriers[body, parent[body, part]] = True
    order = np.argsort(carriers, axis=1, kind="stable")[:, :sensors]
    chosen = np.zeros((rows, parts), dtype=bool)
    np.put_along_axis(chosen, order, True, axis=1)
    return np.where(chosen, np.cumsum(chosen, axis=1) - 1, -1)


def _choose(values: Iterator[float], count: int) -> int:
    return min(int(next(values) * count), count - 1)
