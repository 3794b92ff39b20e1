"""The statistics of the claims table; all tests are SciPy's.

SciPy takes as long to load as all the rest of the command, so it is loaded where it is needed.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

_RESAMPLES: Final = 9999
_SEED: Final = 0


@dataclass(frozen=True, kw_only=True)
class Share:
    """Successes out of trials, with the 95 % interval of their rate (Wilson 1927)."""

    successes: int
    trials: int
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class MeanDifference:
    """Mean of paired differences with its 95 % interval; no interval where there is one pair."""

    mean: float
    low: float | None
    high: float | None


def share(successes: int, trials: int) -> Share:
    """A rate with its interval."""
    interval = _scipy().binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    return Share(
        successes=successes, trials=trials, low=float(interval.low), high=float(interval.high)
    )


def smaller(differences: Sequence[float]) -> float:
    """One-sided p of Wilcoxon's signed-rank test that paired differences tend to be negative.

    Pairs without a difference are left out, as Wilcoxon did.
    """
    return _signed_rank(differences, "less")


def different(differences: Sequence[float]) -> float:
    """Two-sided p of the same test."""
    return _signed_rank(differences, "two-sided")


def mean_difference(differences: Sequence[float]) -> MeanDifference:
    """The mean of paired differences with its bootstrap interval.

    Differences of model quality are skewed: most are small, and a few runs go astray. The
    bias-corrected and accelerated bootstrap (Efron 1987) allows for that; its random source is
    fixed.
    """
    mean = float(np.mean(differences))
    if min(differences) == max(differences):
        known = mean if len(differences) > 1 else None
        return MeanDifference(mean=mean, low=known, high=known)
    interval = (
        _scipy()
        .bootstrap((differences,), np.mean, n_resamples=_RESAMPLES, method="BCa", rng=_SEED)
        .confidence_interval
    )
    return MeanDifference(mean=mean, low=float(interval.low), high=float(interval.high))


def holm(values: Sequence[float]) -> list[float]:
    """Values of p corrected for their number (Holm 1979), in the order given."""
    order = sorted(range(len(values)), key=lambda index: values[index])
    corrected = [0.0] * len(values)
    highest = 0.0
    for rank, index in enumerate(order):
        highest = max(highest, min(1.0, (len(values) - rank) * values[index]))
        corrected[index] = highest
    return corrected


def rates_differ(one: Share, other: Share) -> float:
    """Two-sided p of Fisher's exact test that two rates are the same."""
    table = [[item.successes, item.trials - item.successes] for item in (one, other)]
    return float(_scipy().fisher_exact(table).pvalue)


def mean_and_deviation(values: Sequence[float]) -> tuple[float | None, float | None]:
    """Mean and standard deviation of a sample; ``None`` where there are too few values."""
    mean = float(np.mean(values)) if len(values) else None
    return mean, float(np.std(values, ddof=1)) if len(values) > 1 else None


def _scipy() -> Any:
    return importlib.import_module("scipy.stats")


def _signed_rank(differences: Sequence[float], alternative: Literal["less", "two-sided"]) -> float:
    if not any(differences):
        return 1.0
    return float(_scipy().wilcoxon(differences, alternative=alternative).pvalue)
