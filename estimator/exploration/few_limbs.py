"""Motor programs that move few limbs, where more is open than a few readings can tell.

A reading of many moved limbs holds as much information as one of a few, but constrains them only
jointly: the search would have to try all limbs together. A limb that does not move hardly matters
to a reading, so with few moved limbs a body of many legs is found leg by leg. Where it is not known
which part sits on which, each part that a motor turns is a limb by itself, and samples that agree
sooner than their readings can have informed them are not trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Flags
from estimator.body.morphology import BASE
from estimator.posterior.model.unknowns import Columns, Unknowns

_OPEN_BITS: Final = 24.0
"""Largest entropy of the attachments of all moved limbs, bits: that of three limbs of two parts.
A single limb often lifts into the air, and shows nothing."""

_OPEN_PART_BITS: Final = 12.0
"""Largest entropy where each part is a limb, bits: that of two unknown parts."""

_BITS_LEARNT: Final = 5.0
"""Most bits about attachments that one interaction tells where each part is a limb. Fewer than in
``Unknowns.telling``, since too many moved parts cost more than too few."""


@dataclass(frozen=True, kw_only=True)
class Limbs:
    """The limbs of a problem's bodies: parts that nothing sits on, with all that they sit on.

    Or each part by itself, where it is not known which sits on which.

    Attributes:
        motors: Motors that move each limb.
        choices: Columns of the genes that say how the parts of each limb are attached.
        open: Largest entropy of the attachments of all moved limbs, bits.
        unlearnt: Entropy of all attachments before the first interaction, bits, where samples may
            agree sooner than they should; else 0.
    """

    motors: tuple[Columns, ...]
    choices: tuple[Columns, ...]
    open: float
    unlearnt: float


def limbs_of(unknowns: Unknowns) -> Limbs:
    """The limbs of a problem's bodies; none where few attachments are open from the beginning.

    Where parts may sit on each other, each driven part is a limb.
    """
    body = unknowns.bodies(np.zeros((1, unknowns.size)))
    parents, motors = body.parent[0].tolist(), body.motor[0]
    if not unknowns.many:
        chains, most = [], _OPEN_BITS
    elif unknowns.parents.any():
        chains, most = [[part] for part in np.flatnonzero(motors >= 0).tolist()], _OPEN_PART_BITS
    else:
        tips = sorted(set(range(len(parents))) - set(parents))
        chains, most = [_down_from(tip, parents) for tip in tips], _OPEN_BITS
    choices = tuple(
        np.flatnonzero([gene.part in chain and gene.is_choice for gene in unknowns.genes])
        for chain in chains
    )
    unlearnt = 0.0
    if unknowns.parents.any():
        unlearnt = sum(float(np.log2(unknowns.counts[columns]).sum()) for columns in choices)
    moved = tuple(motors[chain][motors[chain] >= 0] for chain in chains)
    return Limbs(motors=moved, choices=choices, open=most, unlearnt=unlearnt)


def _down_from(tip: int, parents: Sequence[int]) -> list[int]:
    """A part and all parts that it sits on, without the main body."""
    chain = [tip]
    while parents[chain[-1]] != BASE:
        chain.append(parents[chain[-1]])
    return chain


def moved_motors(
    shape: tuple[int, int],
    limbs: Limbs,
    decided: NDArray[np.int64],
    interactions: int,
    rng: np.random.Generator,
) -> Flags:
    """Which motors each program moves: those of few limbs where the attachments of many are open.

    Each program moves limbs in a random order, at least one, up to the entropy that ``limbs``
    allows. Where all limbs together have no more, each moves all motors.

    Args:
        shape: Numbers of programs and motors.
        limbs: Limbs of the bodies, from ``limbs_of``.
        decided: Choices of equally likely samples, by gene, shape (n, genes).
        interactions: Number of interactions that the samples were learnt from.
        rng: Draws the orders.

    Returns:
        Flags of this shape.
    """
    bits = np.array([_entropy(decided[:, columns]) for columns in limbs.choices])
    if bits.size:  # it is not known which limbs samples are wrong about: shared evenly
        bits += max(limbs.unlearnt - _BITS_LEARNT * interactions - bits.sum(), 0.0) / bits.size
    if bits.sum() <= limbs.open:
        return np.ones(shape, dtype=bool)
    order = rng.permuted(np.tile(np.arange(len(bits)), (shape[0], 1)), axis=1)
    few = np.cumsum(bits[order], axis=1) <= limbs.open
    few[:, 0] = True
    moved = np.zeros(shape, dtype=bool)
    for row, limb in zip(*np.nonzero(few), strict=True):
        moved[row, limbs.motors[order[row, limb]]] = True
    return moved


def _entropy(chosen: NDArray[np.int64]) -> float:
    """Entropy of choices, shape (n, columns), as if columns were independent, bits."""
    total = 0.0
    for column in chosen.T:
        shares = np.unique(column, return_counts=True)[1] / len(column)
        total -= float(shares @ np.log2(shares))
    return total
