"""The statistics of the claims table; all tests are scipy's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats


@dataclass(frozen=True, kw_only=True)
class Share:
    """Successes out of trials, with the 95 % interval of their rate (Wilson 1927)."""

    successes: int
    trials: int
    low: float
    high: float


def share(successes: int, trials: int) -> Share:
    """A rate with its interval."""
    interval = stats.binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    return Share(
        successes=successes, trials=trials, low=float(interval.low), high=float(interval.high)
    )


def smaller(sample: Sequence[float], other: Sequence[float]) -> float:
    """One-sided p of the Mann-Whitney test that ``sample`` tends to be smaller than ``other``."""
    return float(stats.mannwhitneyu(sample, other, alternative="less").pvalue)


def different(sample: Sequence[float], other: Sequence[float]) -> float:
    """Two-sided p of the same test."""
    return float(stats.mannwhitneyu(sample, other, alternative="two-sided").pvalue)


def holm(values: Sequence[float]) -> list[float]:
    """Values of p corrected for their number (Holm 1979), in the order given."""
    order = sorted(range(len(values)), key=lambda index: values[index])
    found = [0.0] * len(values)
    highest = 0.0
    for rank, index in enumerate(order):
        highest = max(highest, min(1.0, (len(values) - rank) * values[index]))
        found[index] = highest
    return found


def rates_differ(one: Share, other: Share) -> float:
    """Two-sided p of Fisher's exact test that two rates are the same."""
    table = [[item.successes, item.trials - item.successes] for item in (one, other)]
    return float(stats.fisher_exact(table).pvalue)


def mean_and_deviation(values: Sequence[float]) -> tuple[float | None, float | None]:
    """Mean and standard deviation of a sample; ``None`` where there are too few values."""
    mean = float(np.mean(values)) if len(values) else None
    return mean, float(np.std(values, ddof=1)) if len(values) > 1 else None
