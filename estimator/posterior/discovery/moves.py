"""Proposals of the sampler, all of them symmetric: as likely as their reverse.

The prior is uniform on the unit cube, so a proposal is accepted by the likelihood alone.
"""

from __future__ import annotations

import math
from enum import IntEnum
from itertools import product
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.unknowns import Columns, Unknowns

_SMALLEST: Final = 0.001  # scale of random steps, of a length's range; log-uniform from here
_LARGEST: Final = 0.2  # to here
_ALL_LENGTHS: Final = 0.5  # share of the random steps that move all lengths
_EACH_LENGTH: Final = 0.3  # chance of each length to be moved by the other random steps
_JITTER: Final = 1e-4  # noise that is added to steps along differences, of a length's range
_REHINGED: Final = 0.5  # share of the parts that change places whose hinges are drawn again


class Move(IntEnum):
    """What one proposal changes."""

    LENGTHS = 0
    DIFFERENCE = 1
    ONE_GENE = 2
    TWO_GENES = 3
    PART = 4
    SWAP = 5


_SHARES: Final = (0.35, 0.25, 0.2, 0.1, 0.1)
_SHARES_WITH_SWAPS: Final = (0.3, 0.2, 0.2, 0.1, 0.1, 0.1)
"""Shares of the moves where parts may not share mounts, so that they can only change places."""


def propose(
    values: Array, rows: Columns, partners: Columns, unknowns: Unknowns, rng: np.random.Generator
) -> Array:
    """Proposes a new point for each of some chains, shape (m, size).

    Args:
        values: Points of all chains, shape (n, size).
        rows: Chains to be moved, shape (m,).
        partners: For each of these, two chains that stand still meanwhile, shape (m, 2); their
            difference is a direction.
        unknowns: The cube.
        rng: Random generator of the population.
    """
    proposed = values[rows]
    shares = _SHARES_WITH_SWAPS if unknowns.places else _SHARES
    kinds = rng.choice(len(shares), len(rows), p=shares)
    lengths = unknowns.continuous
    if lengths.size:
        chosen = np.flatnonzero(kinds == Move.LENGTHS)[:, None]
        steps = _random_steps(len(chosen), lengths.size, rng)
        proposed[chosen, lengths] = reflected(proposed[chosen, lengths] + steps)
        chosen = np.flatnonzero(kinds == Move.DIFFERENCE)[:, None]
        first, second = partners[chosen[:, 0]].T[..., None]
        steps = _factors(len(chosen), lengths.size, rng)
        steps = steps * (values[first, lengths] - values[second, lengths])
        steps += rng.normal(0, _JITTER, steps.shape)
        proposed[chosen, lengths] = reflected(proposed[chosen, lengths] + steps)
    for kind, count in ((Move.ONE_GENE, 1), (Move.TWO_GENES, 2)):
        chosen = np.flatnonzero(kinds == kind)
        for _ in range(count):
            columns = rng.integers(unknowns.genes_size, size=chosen.size)
            proposed[chosen, columns] = rng.random(chosen.size)
    chosen = np.flatnonzero(kinds == Move.PART)
    parts = rng.integers(len(unknowns.parts), size=chosen.size)
    for part, columns in enumerate(unknowns.parts.values()):
        of_part = chosen[parts == part]
        proposed[of_part[:, None], columns] = rng.random((of_part.size, columns.size))
    if unknowns.places:
        exchange_places(proposed, values[rows], unknowns)
        _swap(proposed, np.flatnonzero(kinds == Move.SWAP), unknowns, rng)
    return proposed


def _swap(fresh: Array, chosen: Columns, unknowns: Unknowns, rng: np.random.Generator) -> None:
    """Exchanges the places of two parts, in some of the points, and may draw both hinges again.

    A leg in another's place with another hinge often reads much like the other.
    """
    kinds = rng.integers(len(unknowns.places), size=chosen.size)
    for kind, (columns, hinges) in enumerate(zip(unknowns.places, unknowns.hinges, strict=True)):
        rows = chosen[kinds == kind][:, None]
        first = rng.integers(len(columns), size=rows.size)
        second = (first + rng.integers(1, len(columns), size=rows.size)) % len(columns)
        first_genes, second_genes = fresh[rows, columns[first]], fresh[rows, columns[second]]
        fresh[rows, columns[first]], fresh[rows, columns[second]] = second_genes, first_genes
        rehinged = rng.random(rows.size) < _REHINGED
        for part, hinge in enumerate(hinges):
            changed = rows[rehinged & ((first == part) | (second == part))]
            fresh[changed, hinge] = rng.random((changed.size, hinge.size))


def exchange_parts(
    one: Array, other: Array, unknowns: Unknowns, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Pairs of points with one part exchanged between them, to be accepted together.

    Args:
        one: First point of each pair, shape (n, size).
        other: Second point of each pair, shape (n, size).
        unknowns: The cube.
        rng: Random generator of the population.
    """
    first, second = one.copy(), other.copy()
    parts = rng.integers(len(unknowns.parts), size=len(one))
    for part, columns in enumerate(unknowns.parts.values()):
        cells = np.flatnonzero(parts == part)[:, None], columns
        first[cells], second[cells] = other[cells], one[cells]
    return first, second


def reflected(values: Array) -> Array:
    """Values folded back into 0 to 1 at its ends."""
    folded = np.mod(np.abs(values), 2.0)
    return np.where(folded > 1, 2.0 - folded, folded)


def _random_steps(count: int, lengths: int, rng: np.random.Generator) -> Array:
    share = np.where(rng.random((count, 1)) < _ALL_LENGTHS, 1.0, _EACH_LENGTH)
    moved = rng.random((count, lengths)) < share
    moved[np.arange(count), rng.integers(lengths, size=count)] = True
    scale = np.exp(rng.uniform(math.log(_SMALLEST), math.log(_LARGEST), (count, 1)))
    return rng.normal(size=(count, lengths)) * scale * moved


def _factors(count: int, lengths: int, rng: np.random.Generator) -> Array:
    """Steps along differences, as shares of these (ter Braak 2006), now and then around a whole."""
    usual = 2.38 / math.sqrt(2 * lengths)
    whole = rng.random((count, 1)) < 0.2
    return np.where(whole, 1.0, usual) * np.exp(rng.uniform(-1.5, 0.2, (count, 1)))


_RANDOM: Final = 1200  # points that are tried where parents are unknown
_LENGTHS_TRIED: Final = 6  # lengths that are tried with each choice where parents are known


def other_attachments(
    leader: Array, columns: Columns, unknowns: Unknowns, rng: np.random.Generator
) -> Array:
    """Points that differ from a leader in one part's attachment, shape (n, size).

    Each mount with each hinge and several lengths where the part's parent is known, else random
    attachments. Where no two parts may share a mount, the part whose place is taken gets the place
    that becomes free.

    Args:
        leader: The point, shape (size,).
        columns: Columns of the part, from ``Unknowns.parts``.
        unknowns: The cube.
        rng: Draws lengths, and attachments.
    """
    counts = unknowns.counts[columns]
    if unknowns.parents[columns].any() or not counts.any():
        points = np.repeat(leader[None], _RANDOM, axis=0)
        points[:, columns] = rng.random((_RANDOM, columns.size))
        return unknowns.permitted(points)
    cells = np.array(list(product(*map(range, counts[counts > 0])))) + 0.5
    leaders = np.repeat(leader[None], len(cells) * _LENGTHS_TRIED, axis=0)
    points = leaders.copy()
    points[:, columns] = rng.random((len(points), columns.size))
    points[:, columns[counts > 0]] = np.repeat(cells / counts[counts > 0], _LENGTHS_TRIED, axis=0)
    exchange_places(points, leaders, unknowns)
    return unknowns.permitted(points)


def exchange_places(points: Array, before: Array, unknowns: Unknowns) -> None:
    """Moves the part whose mount another part has taken to the mount that this one has left.

    Only where parents are known, and where one part alone has moved: a symmetric proposal stays
    symmetric there, since the two exchange their genes.

    Args:
        points: Points after a part has moved, shape (n, size); changed in place.
        before: The same points before, shape (n, size).
        unknowns: The cube.
    """
    for places in unknowns.places:
        if places.shape[1] > 1 or unknowns.parents[places].any():
            continue
        mounts = places[:, 0]
        chosen, chosen_before = (unknowns.decided(values)[:, mounts] for values in (points, before))
        moved = chosen != chosen_before
        part = np.argmax(moved, axis=1)
        rows = np.arange(len(points))
        taken = (chosen == chosen[rows, part][:, None]) & ~moved
        pair = np.flatnonzero((moved.sum(axis=1) == 1) & (taken.sum(axis=1) == 1))
        mover, displaced = mounts[part[pair]], mounts[np.argmax(taken[pair], axis=1)]
        points[pair, mover], points[pair, displaced] = before[pair, displaced], before[pair, mover]
