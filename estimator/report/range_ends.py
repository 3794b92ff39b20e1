"""Which lengths the readings press against an end of the range that the problem gives them.

If a length lies outside of its range, the samples crowd at the end next to it, and their interval
there is the narrowest of all.
"""

from __future__ import annotations

import math
from typing import Final, Literal, TypeAlias

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.posterior import quantiles
from estimator.storage.posteriors import Record

LEARNT_WIDTH: Final = 0.3
"""Largest width of a posterior's 90 % interval, relative to the prior's, that tells something."""

PRIOR_WIDTH: Final = 3.29
"""Width of a 90 % interval, in standard deviations."""

_End: TypeAlias = Literal["shortest", "longest"]
_ENDS: Final[tuple[_End, _End]] = ("shortest", "longest")
_CROWDED: Final = 0.4  # largest median distance from an end, relative to the 95 % quantile
_NOT_BEFORE: Final = 0.6  # largest 25 % quantile of this distance, relative to its median
_QUANTILES: Final = (0.05, 0.25, 0.5, 0.95)


class LengthAtEnd(Record):
    """A length that the readings press against an end of the range that the problem gives it.

    Attributes:
        parts: Names of the parts that have it: of several that are rigidly joined it is the sum.
        end: Which end of the range.
        length_m: The length at this end, m.
    """

    parts: tuple[str, ...]
    end: _End
    length_m: float


def lengths_at_ends(fitted: FittedPosterior) -> tuple[LengthAtEnd, ...]:
    """Lengths that are pressed against an end of their range; see ``is_pressed``.

    Of parts that are rigidly joined the sum counts: they trade against each other, so that each
    alone reaches the end of its range by right.
    """
    body, genome, samples = fitted.best_body, fitted.genome, fitted.samples
    if body is None:
        return ()
    columns: dict[int, list[int]] = {}
    for column, gene in enumerate(genome.genes):
        if gene.trait == "length":
            columns.setdefault(body.rigid_groups[gene.part], []).append(column)
    at_ends = list[LengthAtEnd]()
    for group in columns.values():
        rules = [fitted.problem.parts[genome.genes[column].part] for column in group]
        spans = np.array([rule.length[1] - rule.length[0] for rule in rules])
        for number, end in enumerate(_ENDS):
            if is_pressed(np.abs(samples[:, group] - number), spans, fitted.weights):
                at_ends.append(
                    LengthAtEnd(
                        parts=tuple(rule.name for rule in rules),
                        end=end,
                        length_m=math.fsum(rule.length[number] for rule in rules),
                    )
                )
    return tuple(at_ends)


def is_pressed(distances: Array, spans: Array, weights: Array) -> bool:
    """Whether a length, or a sum of some, is known, and is likeliest at the end of its range.

    The measure is the share of the prior that lies between a sample and the end, in which the
    prior is flat: near the end it grows as the distance to the power of the number of lengths. The
    median of this share is 0.53 of its 95 % quantile where readings say nothing there, 0.44 where
    the density is a bell with its peak one standard deviation before the end, 0.34 where the
    peak is at the end, and 0.23 where it grows exponentially up to the end. The 25 % quantile rules
    out a density that has its peak before the end and a long tail away from it.

    Args:
        distances: Distance of each length from the end, relative to its span, shape (n, lengths).
        spans: By how much each length may vary, m, shape (lengths,).
        weights: Weights of the samples, shape (n,).
    """
    sums = quantiles(distances @ spans, weights, _QUANTILES)
    low, _, _, high = sums
    prior_width = PRIOR_WIDTH * math.sqrt(float(spans @ spans) / 12)
    _, quarter, half, most = sums ** len(spans)
    is_learnt = high - low < LEARNT_WIDTH * prior_width
    return bool(is_learnt and half < _CROWDED * most and quarter < _NOT_BEFORE * half)
