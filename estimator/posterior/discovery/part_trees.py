"""Bodies as trees of parts: what of them is changed, exchanged or taken over as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from estimator.body.morphology import BASE, Array
from estimator.posterior.model.unknowns import Columns, Unknowns

_MOST: Final = 3  # parts that carry each other, of which legs seldom have more


@dataclass(frozen=True, kw_only=True)
class Joined:
    """Parts of which each carries the next: one, two or three that have something to choose.

    Attributes:
        columns: All of theirs.
        kept: Those of them that stay: of three, where the first one sits; and what another sits on.
        carried: Where that has to be chosen: by which columns, each with the value that does it.
    """

    columns: Columns
    kept: tuple[int, ...] = ()
    carried: tuple[tuple[int, float], ...] = ()


def joined_parts(unknowns: Unknowns) -> tuple[Joined, ...]:
    """What is best put on in another way together.

    Where parents are known, the parts of a limb; where they are not, but many things are, each part
    by itself and with each that may sit on it.
    """
    if not unknowns.parents.any():
        return _joined(unknowns)
    return _possibly_joined(unknowns) if unknowns.many else ()


def subtrees(point: Array, unknowns: Unknowns) -> list[Columns]:
    """Columns of each part together with those of all that it carries.

    Args:
        point: Of the cube, shape (size,).
        unknowns: The cube.
    """
    parents = unknowns.bodies(point[None]).parent[0].tolist()
    carried = [{part} for part in range(len(parents))]
    for part in reversed(range(len(parents))):
        if parents[part] != BASE:
            carried[parents[part]] |= carried[part]
    return [
        np.flatnonzero([gene.part in together for gene in unknowns.genes]) for together in carried
    ]


def exchanged(point: Array, unknowns: Unknowns) -> Array:
    """Points in which two parts that may sit anywhere have each other's genes.

    Each pair once with what the two carry going along, and once with that staying where it is.

    Args:
        point: Shape (size,).
        unknowns: The cube.

    Returns:
        Shape (n, size).
    """
    genes, own = unknowns.genes, _columns_of_parts(unknowns)
    choosing = {genes[at].part: at for at in np.flatnonzero(unknowns.parents).tolist()}
    carriers = unknowns.bodies(point[None]).parent[0].tolist()
    points = []
    for one, other in combinations(choosing, 2):
        traits, theirs = ([genes[at].trait for at in own[part]] for part in (one, other))
        if traits != theirs or carriers[other] >= one:
            continue
        along = point.copy()
        along[own[one]], along[own[other]] = point[own[other]], point[own[one]]
        along[choosing[one]] = _sitting_on(carriers[other], choosing[one], unknowns)
        along[choosing[other]] = _sitting_on(carriers[one], choosing[other], unknowns)
        staying = along.copy()
        for part, column in choosing.items():
            after = {one: other, other: one}.get(carriers[part], part)
            if after < part:
                staying[column] = _sitting_on(after, column, unknowns)
        points += [along, staying]
    return np.array(points).reshape(len(points), unknowns.size)


def _sitting_on(carrier: int, column: int, unknowns: Unknowns) -> float:
    """The value with which a column chooses a part, or the main body, as its part's parent."""
    return float((carrier + 1.5) / unknowns.counts[column])


def _columns_of_parts(unknowns: Unknowns) -> dict[int, list[int]]:
    own: dict[int, list[int]] = {}
    for column, gene in enumerate(unknowns.genes):
        own.setdefault(gene.part, []).append(column)
    return own


def _possibly_joined(unknowns: Unknowns) -> tuple[Joined, ...]:
    genes, own = unknowns.genes, _columns_of_parts(unknowns)
    chosen = [part for part in own if any(genes[at].choices > 1 for at in own[part])]
    joined = [Joined(columns=np.array(own[part])) for part in chosen]
    for part in chosen:
        for column in own[part]:
            gene = genes[column]
            if gene.trait == "parent":
                joined += [
                    Joined(
                        columns=np.array(own[carrier] + own[part]),
                        kept=(column,),
                        carried=((column, _sitting_on(carrier, column, unknowns)),),
                    )
                    for carrier in chosen
                    if carrier < part
                ]
            elif gene.trait == "mount" and gene.parent in chosen:
                joined.append(Joined(columns=np.array(own[gene.parent] + own[part])))
    return tuple(joined)


def _joined(unknowns: Unknowns) -> tuple[Joined, ...]:
    genes, own = unknowns.genes, _columns_of_parts(unknowns)
    chosen = {gene.part: gene.parent for gene in genes if gene.choices > 1}
    carriers = {
        part: parent for part, parent in chosen.items() if parent is not None and parent in chosen
    }
    joined = []
    for part in chosen:
        chain = [part]
        while len(chain) < _MOST and chain[0] in carriers:
            chain.insert(0, carriers[chain[0]])
        if chain == [part] and part in carriers.values():
            continue  # it is tried with those that it carries
        mounts = [column for column in own[chain[0]] if genes[column].trait == "mount"]
        joined.append(
            Joined(
                columns=np.array([column for one in chain for column in own[one]]),
                kept=tuple(mounts) if len(chain) == _MOST else (),
            )
        )
    return tuple(joined)
