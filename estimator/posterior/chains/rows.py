"""Other rows of one part: what a body would be with that part put on in every other way."""

from __future__ import annotations

from itertools import product
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.unknowns import Columns, Unknowns

_RANDOM: Final = 800  # points, where parents are unknown
_LENGTHS: Final = 16  # tried with each choice, where they are known


def other_attachments(
    leader: Array, columns: Columns, unknowns: Unknowns, rng: np.random.Generator
) -> Array:
    """Points that differ from a leader in one part's row.

    Each mount with each hinge and several lengths, where the part's parent is known; else random
    rows. A part that takes another's place leaves its own to it, where no two may share one.

    Args:
        leader: Shape (size,).
        columns: The part's: one of ``Unknowns.parts``.
        unknowns: The cube.
        rng: Draws lengths, and rows.

    Returns:
        Shape (n, size).
    """
    counts = unknowns.counts[columns]
    if unknowns.parents[columns].any() or not counts.any():
        points = np.repeat(leader[None], _RANDOM, axis=0)
        points[:, columns] = rng.random((_RANDOM, columns.size))
        return unknowns.permitted(points)
    cells = np.array(list(product(*map(range, counts[counts > 0])))) + 0.5
    leaders = np.repeat(leader[None], len(cells) * _LENGTHS, axis=0)
    points = leaders.copy()
    points[:, columns] = rng.random((len(points), columns.size))
    points[:, columns[counts > 0]] = np.repeat(cells / counts[counts > 0], _LENGTHS, axis=0)
    exchange_places(points, leaders, unknowns)
    return unknowns.permitted(points)


def exchange_places(points: Array, before: Array, unknowns: Unknowns) -> None:
    """Moves who sat on a mount that another part has come to sit on to where that one was.

    Only where parents are known, and where one part alone has moved: there, a symmetric proposal
    stays symmetric, since the two have exactly each other's genes.

    Args:
        points: Shape (n, size); changed in place.
        before: What they were.
        unknowns: The cube.
    """
    for places in unknowns.places:
        if places.shape[1] > 1 or unknowns.parents[places].any():
            continue
        mounts = places[:, 0]
        now, then = (unknowns.decided(values)[:, mounts] for values in (points, before))
        moved = now != then
        part = np.argmax(moved, axis=1)
        rows = np.arange(len(points))
        taken = (now == now[rows, part][:, None]) & ~moved
        pair = np.flatnonzero((moved.sum(axis=1) == 1) & (taken.sum(axis=1) == 1))
        own, other = mounts[part[pair]], mounts[np.argmax(taken[pair], axis=1)]
        points[pair, own], points[pair, other] = before[pair, other], before[pair, own]
