"""Special functions of SciPy, loaded when first used: other commands do not wait for them."""

from __future__ import annotations

import importlib
from functools import cache
from typing import Any

import numpy as np

from estimator.body.morphology import Array


@cache
def _scipy() -> Any:
    return importlib.import_module("scipy.special")


def logsumexp(logs: Any, axis: int | None = None) -> Any:
    """Logarithm of a sum of exponentials: an array along an axis, else a number.

    Several times as fast as SciPy's, which computes most of it twice.
    """
    values = np.asarray(logs, dtype=float)
    largest = np.max(values, axis=axis, keepdims=True, initial=-np.inf)
    largest = np.where(np.isfinite(largest), largest, 0.0)
    with np.errstate(divide="ignore"):  # a sum of nothing
        sums = np.log(np.sum(np.exp(values - largest), axis=axis))
    return sums + largest.reshape(sums.shape)


def log_sum(one: Array, other: Array) -> Array:
    """Logarithm of the sum of two exponentials, one of them finite; faster than ``logaddexp``."""
    logs: Array = np.maximum(one, other) + np.log1p(np.exp(-np.abs(one - other)))
    return logs


def softmax(logs: Array) -> Array:
    """Exponentials, scaled to add up to 1, shape (n,)."""
    weights: Array = np.exp(logs - logsumexp(logs))
    return weights


def expit(logits: Array) -> Array:
    """The logistic function."""
    shares: Array = _scipy().expit(logits)
    return shares


def ndtr(values: Array) -> Array:
    """The normal distribution function."""
    shares: Array = _scipy().ndtr(values)
    return shares


def at_least(hits: Array, trials: Array, chance: float) -> Array:
    """Probability of ``hits`` or more in independent trials, each with that chance of a hit."""
    tail: Array = _scipy().bdtrc(hits - 1, trials, chance)
    return tail
