"""Genomes: gene arrays in [0, 1] that encode bodies.

``genes`` says what each gene decides. A gene that stands for a choice among k is scaled to the
integers 0 to k − 1; row i chooses its parent among the main body and the i − 1 earlier parts, and
its mount among those of that parent.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from estimator.body.arrays import Bodies, Flags, Integers
from estimator.body.morphology import BASE, Array, Base, Morphology, Part
from estimator.errors import MorphologyError, SearchStateError
from estimator.problem.attachment_tables import Place
from estimator.problem.genes import Gene, GeneColumns, Traits, genes_of
from estimator.problem.problem import Problem

DECIDED: Final = (*Traits._fields, "sensor")
"""The arrays of ``Bodies`` that genes decide."""

_DRAWS: Final = 1_000  # draws of places for all parts, by which ways to attach them are counted


class Ways(NamedTuple):
    """How many ways there are to attach the parts of a problem.

    Attributes:
        number: Their number.
        exact: Whether it was counted, and not estimated.
    """

    number: float
    exact: bool


class Genome:
    """Decodes gene arrays into bodies, for one problem on one robot.

    Args:
        problem: What is known and what is to be found.
        base: The robot's main body, with the mounts of the problem: ``Problem.base``.

    Attributes:
        genes: What each gene decides.

    Raises:
        MorphologyError: The main body has other mounts than parts of the problem sit on.
    """

    def __init__(self, problem: Problem, base: Base) -> None:
        if len(base.mounts) != len(problem.tables.base_mounts(base.size)):
            raise MorphologyError(
                f"the main body has {len(base.mounts)} mounts, and {problem.name} is about "
                f"{len(problem.tables.base_mounts(base.size))}: take it from Problem.base"
            )
        self._problem = problem
        self._base = base
        self.genes: tuple[Gene, ...] = genes_of(problem.parts, problem.tables)

    @property
    def size(self) -> int:
        """Number of genes."""
        return len(self.genes)

    def choices(self, genes: Array) -> Integers:
        """What the genes of n genomes choose, as numbers from 0; −1 for lengths.

        Args:
            genes: Shape (n, size), each in [0, 1].

        Returns:
            Choices, shape (n, size).
        """
        values, columns = np.asarray(genes, dtype=float), self._columns
        chosen = _scaled(values, columns.counts)
        if columns.open_mounts.size:
            counts = self._mounts_of_parents(chosen)
            chosen[:, columns.open_mounts] = _scaled(values[:, columns.open_mounts], counts)
        return chosen

    def log_room(self, genes: Array) -> Array:
        """How much of the cube of genes stands for the choices of each of n genomes, shape (n,).

        Returns:
            Logarithms; 0 where every part of unknown parent sits on a carrier that has the more
            mounts: each of fewer mounts has more room.
        """
        if not self._columns.open_mounts.size:
            return np.zeros(len(genes))
        tables = self._problem.tables
        mounts = max(tables.base_choices, tables.part_choices)
        rooms: Array = np.log(mounts / self._mounts_of_parents(self.choices(genes))).sum(axis=1)
        return rooms

    def _mounts_of_parents(self, chosen: Integers) -> Integers:
        """Number of mounts that parts of unknown parent and mount choose from, shape (n, parts)."""
        tables = self._problem.tables
        on_base = chosen[:, self._columns.their_parents] == 0
        return np.where(on_base, tables.base_choices, tables.part_choices)

    def words(self, column: int, genes: Array) -> tuple[str, ...]:
        """What a gene stands for on each of n genomes: the name of a part, a mount or a hinge."""
        gene, tables = self.genes[column], self._problem.tables
        if gene.trait == "parent":
            names = ["main body", *(part.name for part in self._problem.parts)]
            return tuple(names[choice] for choice in self.choices(genes)[:, column].tolist())
        traits = self._traits(np.asarray(genes, dtype=float))
        chosen = getattr(traits, gene.trait)[:, gene.part].tolist()
        if gene.trait == "hinge":
            return tuple(tables.hinges[choice].name for choice in chosen)
        return tuple(
            (self._base.mounts if parent == BASE else tables.part_mounts)[choice].name
            for parent, choice in zip(traits.parent[:, gene.part].tolist(), chosen, strict=True)
        )

    def quantities(self, column: int, genes: Array) -> Array:
        """Lengths that n genes of one column, between 0 and 1, stand for, mm, shape (n,)."""
        low, high = self._problem.parts[self.genes[column].part].length
        return 1000 * (low + genes * (high - low))

    def decode(self, genes: Array) -> Morphology:
        """Returns the body that a genome encodes.

        Args:
            genes: Shape (size,), each in [0, 1].

        Raises:
            SearchStateError: The shape is wrong or a gene lies outside [0, 1].
        """
        (body,) = self.decode_all(np.asarray(genes, dtype=float)[None])
        return body

    def decode_all(self, genes: Array) -> list[Morphology]:
        """Returns the bodies that the rows of an array of shape (n, size) encode.

        Raises:
            SearchStateError: The shape is wrong or a gene lies outside [0, 1].
        """
        values = self._checked(genes)
        rows = (array.tolist() for array in self._traits(values))
        return [
            self.assemble(
                [
                    Part(
                        parent=parent,
                        mount=mount,
                        hinge=hinge,
                        length=length,
                        radius=rule.radius,
                        motor=rule.motor,
                        sensor=rule.sensor,
                        shape=rule.shape,
                    )
                    for rule, parent, mount, hinge, length in zip(
                        self._problem.parts, *row, strict=True
                    )
                ]
            )
            for row in zip(*rows, strict=True)
        ]

    def assemble(self, parts: Sequence[Part]) -> Morphology:
        """Returns the body that parts make up on this robot, with its touch sensors.

        Args:
            parts: Parts, in the order of the problem's rows.
        """
        if self._problem.touch == "outermost":
            parts = with_outermost_sensors(parts, self._problem.sensors)
        tables = self._problem.tables
        return Morphology(
            base=self._base,
            parts=tuple(parts),
            density=self._problem.density,
            part_mounts=tables.part_mounts,
            hinges=tables.hinges,
        )

    def bodies(self, genes: Array, like: Bodies | None = None) -> Bodies:
        """Bodies of genomes as arrays, without an object per body.

        Args:
            genes: Shape (n, size), each in [0, 1].
            like: One body that says what genes do not decide; default: as the problem says.

        Raises:
            SearchStateError: The shape is wrong or a gene lies outside [0, 1].
        """
        values = self._checked(genes)
        bodies = (self._any_body if like is None else like)[np.zeros(len(values), dtype=np.intp)]
        traits = self._traits(values)
        changes: dict[str, Array | Integers] = traits._asdict()
        if self._problem.touch == "outermost" and self._problem.sensors < len(self._problem.parts):
            changes["sensor"] = outermost_sensors(traits.parent, self._problem.sensors)
        return bodies.changed(**changes)

    @cached_property
    def _columns(self) -> GeneColumns:
        return GeneColumns.of(self._problem.parts, self._problem.tables, self.genes)

    @cached_property
    def _any_body(self) -> Bodies:
        """One body, for all that genes do not change."""
        return Bodies.of(self.decode_all(np.zeros((1, self.size))))

    @property
    def forbids(self) -> bool:
        """Whether some genomes are no body of the problem: see ``forbidden``."""
        return not self._problem.share_mounts

    def forbidden(self, genes: Array) -> Flags:
        """Which of n genomes put two parts on a mount that the problem does not let them share.

        Args:
            genes: Shape (n, size).
        """
        if not self.forbids:
            return np.zeros(len(genes), dtype=bool)
        traits = self._traits(np.asarray(genes, dtype=float))
        stride = len(self._base.mounts) + len(self._problem.tables.part_mounts)
        places = np.sort(traits.parent * stride + traits.mount, axis=1)
        doubles: Flags = np.any(places[:, 1:] == places[:, :-1], axis=1)
        return doubles

    def ways(self, rng: np.random.Generator) -> Ways:
        """How many ways there are to attach the parts, as far as a sensor may show which.

        Where mounts are not shared it is found by drawing places for one part after another, those
        with the fewest first: exact if all draws leave as many, as where parts have the same
        places, and else an estimate.

        Args:
            rng: Draws places.
        """
        places = sorted(self._problem.tables.places, key=len)
        hinges = [gene.choices for gene in self.genes if gene.trait == "hinge" and gene.observable]
        if not self.forbids:
            return Ways(math.prod([*map(len, places), *hinges]), exact=True)
        counts = [_count_of_a_draw(places, rng) for _ in range(_DRAWS)]
        number = math.prod(hinges) * sum(counts) / len(counts)
        return Ways(number, exact=min(counts) == max(counts))

    def permitted(self, genes: Array) -> Array:
        """Genomes with each part that sits on a mount that is taken moved to the next free one.

        See ``spread``. Where there is no free mount a genome stays forbidden.

        Args:
            genes: Shape (n, size), each in [0, 1].
        """
        values = np.array(genes, dtype=float)
        crowded = np.flatnonzero(self.forbidden(values))
        if crowded.size:
            _, firsts, kinds = np.unique(
                self.choices(values[crowded]), axis=0, return_index=True, return_inverse=True
            )
            for kind, first in enumerate(firsts):
                rows = crowded[kinds.ravel() == kind]
                for column, gene in self._moves(values[crowded[first]]):
                    values[rows, column] = gene
        return values

    def _moves(self, genes: Array) -> Iterator[tuple[int, float]]:
        """New values of genes, by column, that take parts off mounts that others have."""
        columns = {(gene.part, gene.trait): column for column, gene in enumerate(self.genes)}
        traits = self._traits(genes[None])
        wanted = list(zip(traits.parent[0].tolist(), traits.mount[0].tolist(), strict=True))
        for part, (parent, mount) in enumerate(spread(self._problem, wanted)):
            if parent != wanted[part][0]:
                yield columns[part, "parent"], (parent - BASE + 0.5) / (part + 1)
            if (parent, mount) != wanted[part] and (part, "mount") in columns:
                choices = len(self._problem.tables.mount_names(parent))
                yield columns[part, "mount"], (mount + 0.5) / choices

    def _traits(self, values: Array) -> Traits:
        """Parents, mounts, hinges and lengths of n genomes."""
        columns = self._columns
        known = columns.known[None].repeat(len(values), axis=0)
        numbers = np.concatenate([self.choices(values), known], axis=1)
        parent, mount, hinge = numbers.take(columns.chosen, axis=1).swapaxes(0, 1)
        length = columns.shortest + values.take(columns.lengths, axis=1) * columns.spans
        traits = Traits(parent + BASE, mount, hinge, length)
        parts = columns.mounted
        if parts.size:
            on_base = traits.parent[:, parts] == BASE
            traits.mount[:, parts] = np.where(on_base, columns.on_base, columns.on_part)
        return traits

    def _checked(self, genes: Array) -> Array:
        values = np.asarray(genes, dtype=float)
        if values.ndim != 2 or values.shape[1] != self.size:
            raise SearchStateError(f"genomes have {self.size} genes, not shape {values.shape}")
        if not np.all((values >= 0) & (values <= 1)):
            raise SearchStateError("every gene must lie in 0 to 1")
        return values


def _scaled(values: Array, counts: Integers) -> Integers:
    """Genes as choices among ``counts`` values each; −1 where there are 0."""
    return np.minimum((values * counts).astype(np.int64), counts - 1)


def with_outermost_sensors(parts: Sequence[Part], sensors: int) -> list[Part]:
    """Parts with ``sensors`` touch sensors, first on those that carry no part; see ``Problem``."""
    carriers = {part.parent for part in parts}
    chosen = sorted(range(len(parts)), key=lambda index: (index in carriers, index))[:sensors]
    numbers = {index: number for number, index in enumerate(sorted(chosen))}
    return [replace(part, sensor=numbers.get(index)) for index, part in enumerate(parts)]


def outermost_sensors(parent: Integers, sensors: int) -> Integers:
    """Touch sensors of parts of n bodies, first on those that carry no part; −1: none; (n, parts).

    Args:
        parent: Parent of each part, shape (n, parts).
        sensors: Number of touch sensors.
    """
    rows, parts = parent.shape
    carriers = np.zeros((rows, parts + 1), dtype=bool)  # the main body's, −1, in the last column
    carriers[np.arange(rows)[:, None], parent] = True
    carriers = carriers[:, :parts]
    outermost = np.cumsum(~carriers, axis=1)
    place = np.where(carriers, outermost[:, -1:] + np.cumsum(carriers, axis=1), outermost)
    chosen = place <= sensors
    return np.where(chosen, np.cumsum(chosen, axis=1) - 1, -1)


def spread(problem: Problem, wanted: Sequence[Place]) -> list[Place]:
    """Places for all parts with no two on one mount, as far as there are free ones.

    Parts that are known to sit somewhere keep their places; earlier ones go before later ones. Each
    that finds its mount taken goes to the next free one of its parent, or else of another.

    Args:
        problem: Says where each part may sit.
        wanted: Where each part would sit.
    """
    rules = problem.parts
    fixed = [rule.parent is not None and rule.mount is not None for rule in rules]
    taken = {place for place, stays in zip(wanted, fixed, strict=True) if stays}
    places = list(wanted)
    for part, (parent, mount) in enumerate(wanted):
        if fixed[part]:
            continue
        free_places = [place for place in problem.tables.places[part] if place not in taken]
        next_places = [place for place in free_places if place[0] == parent and place[1] >= mount]
        places[part] = min(
            next_places or [place for place in free_places if place[0] == parent] or free_places,
            default=(parent, mount),
        )
        taken.add(places[part])
    return places


def _count_of_a_draw(places: Sequence[Sequence[Place]], rng: np.random.Generator) -> int:
    """Number of ways to place parts if each has as many free places as in one random draw.

    Its mean is the number of ways: each is drawn with the probability 1 / count.

    Args:
        places: Where each part may sit.
        rng: Draws where it does.
    """
    count, taken = 1, set[Place]()
    for possible in places:
        free_places = [place for place in possible if place not in taken]
        if not free_places:
            return 0
        count *= len(free_places)
        taken.add(free_places[rng.integers(len(free_places))])
    return count
