"""What each gene of a problem's genomes decides, and which columns have genes of a kind.

A genome goes through the problem's parts in order. Each part contributes one gene for each thing
that is to be found about it, in the order of the paper's rows: parent P, mount O, hinge J, length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Integers
from estimator.body.morphology import BASE, Array
from estimator.problem.attachment_tables import AttachmentTables
from estimator.problem.sections import PartRule

Indices: TypeAlias = NDArray[np.intp]


@dataclass(frozen=True, kw_only=True)
class Gene:
    """What one gene decides.

    Attributes:
        part: Index of the part.
        trait: The part's trait that it decides.
        choices: Largest number of values that it chooses from: the main body may have more or
            fewer mounts than parts have. 0: any value in a range.
        name: Name for people.
        parent: Index of what the part sits on, where that is known.
        unit: Unit, for people, of a value in a range.
        observable: Whether a sensor may show what it decides: never for the hinge of a locked part.
    """

    part: int
    trait: Literal["parent", "mount", "hinge", "length"]
    choices: int
    name: str
    parent: int | None = None
    unit: str = ""
    observable: bool = True

    @property
    def is_choice(self) -> bool:
        """Whether the gene chooses among several values, and a sensor may show which."""
        return self.choices > 1 and self.observable

    @property
    def can_be_found(self) -> bool:
        """Whether the gene has more than one value, and a sensor may show which."""
        return self.choices != 1 and self.observable


class Traits(NamedTuple):
    """How parts are attached and how long they are, of n bodies, shape (n, parts) each."""

    parent: Integers
    mount: Integers
    hinge: Integers
    length: Array


@dataclass(frozen=True, kw_only=True)
class GeneColumns:
    """Which columns of genomes say what, so that n of them are read at once.

    Attributes:
        counts: How many values each column chooses from; 0: any in a range. Shape (size,).
        open_mounts: Columns of mounts of parts whose parents genes choose, too.
        their_parents: Columns of the parents of these parts.
        known: Choices that no gene makes, to be read as further columns.
        chosen: Columns of parents, mounts and hinges, further ones included, shape (3, parts).
        lengths: Columns of lengths, shape (parts,); any where the length is known.
        shortest: Shortest lengths, m, shape (parts,).
        spans: By how much lengths may be larger than the shortest, m, shape (parts,).
        mounted: Indices of parts whose mount is known and whose parent is not.
        on_base: Mounts of these parts if they sit on the main body.
        on_part: Mounts of these parts if they sit on a part.
    """

    counts: Integers
    open_mounts: Indices
    their_parents: Indices
    known: Integers
    chosen: Indices
    lengths: Indices
    shortest: Array
    spans: Array
    mounted: Indices
    on_base: Integers
    on_part: Integers

    @classmethod
    def of(
        cls, rules: Sequence[PartRule], tables: AttachmentTables, genes: Sequence[Gene]
    ) -> GeneColumns:
        """The columns of the genomes of a problem with these parts."""
        attached = tables.attached
        places: dict[tuple[str, int], int] = {
            (gene.trait, gene.part): column for column, gene in enumerate(genes)
        }

        open_parts = [
            part for trait, part in places if trait == "mount" and ("parent", part) in places
        ]
        mounted = [
            part
            for part, rule in enumerate(rules)
            if rule.mount is not None and ("parent", part) in places
        ]
        known = {
            "parent": [0 if rule.parent is None else rule.parent - BASE for rule in rules],
            "mount": [
                (attachment.on_base if rule.parent == BASE else attachment.on_part) or 0
                for attachment, rule in zip(attached, rules, strict=True)
            ],
            "hinge": [attachment.hinge or 0 for attachment in attached],
        }
        chosen = [
            places.get(place, len(genes) + number)
            for number, place in enumerate(product(known, range(len(rules))))
        ]
        return cls(
            counts=np.array([gene.choices for gene in genes], dtype=np.int64),
            open_mounts=np.array([places["mount", part] for part in open_parts], dtype=np.intp),
            their_parents=np.array([places["parent", part] for part in open_parts], dtype=np.intp),
            known=np.array(list(known.values()), dtype=np.int64).ravel(),
            chosen=np.array(chosen, dtype=np.intp).reshape(len(known), -1),
            lengths=np.array([places.get(("length", part), 0) for part in range(len(rules))]),
            shortest=np.array([rule.length[0] for rule in rules]),
            spans=np.array([rule.length[1] - rule.length[0] for rule in rules]),
            mounted=np.array(mounted, dtype=np.intp),
            on_base=np.array([attached[part].on_base or 0 for part in mounted], dtype=np.int64),
            on_part=np.array([attached[part].on_part or 0 for part in mounted], dtype=np.int64),
        )


def genes_of(rules: Sequence[PartRule], tables: AttachmentTables) -> tuple[Gene, ...]:
    """The genes of a problem with these parts."""
    return tuple(
        gene for index, rule in enumerate(rules) for gene in _genes_of_part(index, rule, tables)
    )


def _genes_of_part(index: int, rule: PartRule, tables: AttachmentTables) -> list[Gene]:
    mounts = max(tables.base_choices, tables.part_choices)
    if rule.parent is not None or index == 0:
        mounts = tables.part_choices if rule.parent not in (None, BASE) else tables.base_choices
    traits: tuple[tuple[Literal["parent", "mount", "hinge", "length"], bool, int], ...] = (
        ("parent", rule.parent is None, index + 1),
        ("mount", rule.mount is None, mounts),
        ("hinge", rule.hinge is None, tables.hinge_choices),
        ("length", rule.length_unknown, 0),
    )
    return [
        Gene(
            part=index,
            trait=trait,
            choices=choices,
            name=f"{trait} of {rule.name}",
            parent=rule.parent,
            unit="" if choices else "mm",
            observable=trait != "hinge" or rule.motor is not None,
        )
        for trait, unknown, choices in traits
        if unknown
    ]
