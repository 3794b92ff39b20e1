"""The posterior over bodies: weighted samples, and modes, one for each set of attachments."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Self

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.posterior.model.unknowns import Attachments, Columns

_ALWAYS_MISSED: Final = 0.05  # share of the posterior, in estimates of coverage

MOSTLY: Final = 0.5
"""Part of a mode that must be indistinguishable from the first for the mode to count as such."""


@dataclass(frozen=True)
class Mode:
    """One set of attachments.

    Attributes:
        attachments: The chosen values, in the order of the columns that choose.
        probability: Share of the posterior.
        point: Best point of the cube with these attachments, shape (size,).
        ess: Effective number of draws behind the probability.
        found: Whether each population has found it.
    """

    attachments: Attachments
    probability: float
    point: Array
    ess: float
    found: tuple[bool, ...]


class CauseShare(NamedTuple):
    """How probable one wide component of the table of parameters is.

    Attributes:
        row: Row of the table.
        probability: Share of the posterior.
        low: 5 % quantile of the deviation, in the units of ``parameters.table.applied``, in the
            posterior with this component.
        median: Median of the deviation there.
        high: 95 % quantile of the deviation there.
    """

    row: int
    probability: float
    low: float
    median: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """Weighted samples, and the modes in order.

    Attributes:
        values: Points of the cube, shape (n, size).
        scales: Logarithms of the noise factors on tilt and clearance, shape (n, 2).
        weights: Weights of the samples, adding up to 1, shape (n,).
        modes: The modes, the most probable first.
        adequate_fit: Whether the readings are explained so well that a body can be probable.
        changed: How far each sample is by now from what it was when it was identified, standard
            normal before any reading, shape (n, changes); ``None``: nothing has changed.
        causes: Deviations from what is stated that may explain the readings, most probable first.
        as_stated: Points of the first mode, shape (m, size), without any deviations; ``None``: not
            computed, or the samples have none.
    """

    values: Array
    scales: Array
    weights: Array
    modes: tuple[Mode, ...]
    adequate_fit: bool
    changed: Array | None = None
    causes: tuple[CauseShare, ...] = ()
    as_stated: Array | None = None

    @classmethod
    def equally_likely(
        cls, values: Array, scales: Array | None = None, changed: Array | None = None
    ) -> Self:
        """A posterior of equally likely samples, under the announced noise by default."""
        count = len(values)
        return cls(
            values=values,
            scales=np.zeros((count, 2)) if scales is None else scales,
            weights=np.full(count, 1 / count),
            modes=(),
            adequate_fit=False,
            changed=changed,
        )

    def sample(self, count: int, rng: np.random.Generator) -> Self:
        """At most ``count`` equally likely samples, drawn by their weights."""
        rows = systematic(self.weights, min(count, len(self.weights)), float(rng.random()))
        changed = None if self.changed is None else self.changed[rows]
        return self.equally_likely(self.values[rows], self.scales[rows], changed)


def systematic(weights: Array, count: int, start: float) -> Columns:
    """Indices of ``count`` samples, each as often as its weight says to within one.

    Args:
        weights: Weights of the samples, adding up to 1, shape (n,).
        count: Number of indices.
        start: Offset between 0 and 1; expected counts are exact if it is drawn uniformly.
    """
    ends = np.cumsum(weights)
    places = (np.arange(count) + start) / count * ends[-1]
    rows: Columns = np.searchsorted(ends, places, side="right")
    return rows


def quantiles(values: Array, weights: Array, shares: Sequence[float]) -> Array:
    """The least of n values up to which these shares of their weights lie, shape (shares,)."""
    order = np.argsort(values)
    places: Columns = np.searchsorted(np.cumsum(weights[order]), shares)
    chosen: Array = values[order[places.clip(max=len(values) - 1)]]
    return chosen


def coverage(shares: Array, found: Flags) -> float:
    """Share of the posterior that the populations have found, by capture and recapture.

    As in counting animals by catching them twice: of what one population found, the share that the
    others found, too, estimates the probability with which they find anything. So no population may
    learn from another. Where both have found only a small share of the posterior it says little of
    that probability, so a small share is always counted as missed.

    Args:
        shares: Shares of the posterior, shape (n,).
        found: Which of these each population has found, shape (n, populations).
    """
    missed = 1.0
    for population in range(found.shape[1]):
        by_others = np.delete(found, population, axis=1).any(axis=1)
        share_of_others = shares[by_others].sum()
        share_of_both = shares[by_others & found[:, population]].sum()
        missed *= 1 - share_of_both / (share_of_others + _ALWAYS_MISSED * (1 - share_of_others))
    return float(1.0 - missed)


def coverage_of_classes(shares: Array, found: Flags, indistinguishable: Array) -> float:
    """Coverage, where modes that are indistinguishable from the first count as one.

    A mode of which only a trifle is so, such as one leg so short that it touches nothing, does not
    stand for the first.

    Args:
        shares: Share of the posterior that each mode has, shape (n,).
        found: Which modes each population has found, shape (n, populations).
        indistinguishable: Part of each mode that is indistinguishable from the first, shape (n,).
    """
    classes = np.append(shares * (1 - indistinguishable), shares @ indistinguishable)
    return coverage(classes, np.vstack([found, found[indistinguishable >= MOSTLY].any(axis=0)]))


def found_by_each(keys: Sequence[Attachments], found: Sequence[Collection[Attachments]]) -> Flags:
    """Which of n sets of attachments each population has found, shape (n, populations)."""
    flags: Flags = np.array([[key in known for known in found] for key in keys], dtype=bool)
    return flags.reshape(len(keys), len(found))
