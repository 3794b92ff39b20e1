"""The family of a sensor's noise: how readings scatter about what a body predicts, here normally.

Everything that the estimator takes from the family is in this file: the density and its tail, which
``mixture`` compiles; draws, for readings that are predicted; the weight of a residual in a
Gauss-Newton step; and what a right body loses beside a perfect fit. All are of the standard
distribution, in units of the noise, symmetric about 0 and highest there.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from estimator.body.morphology import Array

_ROOT_HALF: Final = math.sqrt(0.5)
_FAR: Final = 30.0  # standard residuals, beyond which the error function underflows

LOG_PEAK: Final = -0.5 * math.log(2 * math.pi)
"""Logarithm of the density at 0."""

MEAN_LOSS: Final = 0.5
"""Mean of ``-log_shape``: what a reading costs the right body on average, nats."""

VARIANCE_LOSS: Final = 0.5
"""Variance of ``-log_shape``."""

SCALE_INFORMATION: Final = 2.0
"""Fisher information of one reading about the logarithm of the noise."""


def log_shape(residual: float) -> float:
    """Logarithm of the density beside that at 0; to be compiled, as the next one is."""
    return -0.5 * residual * residual


def log_above(residual: float) -> float:
    """Logarithm of the probability of a greater residual."""
    if residual > _FAR:  # asymptotic series of Mills' ratio
        square = residual * residual
        log_density = LOG_PEAK - 0.5 * square
        return log_density - math.log(residual) + math.log1p((3 / square - 1) / square)
    if residual < 0:
        return math.log1p(-0.5 * math.erfc(-residual * _ROOT_HALF))
    return math.log(0.5 * math.erfc(residual * _ROOT_HALF))


def drawn(shape: int | tuple[int, ...], rng: np.random.Generator) -> Array:
    """Deviations at random, of that shape."""
    return rng.normal(size=shape)


def step_weight(residuals: Array) -> Array:
    """Weight of residuals in iteratively reweighted least squares, of any shape.

    That is minus the slope of ``log_shape``, divided by the residual.
    """
    return np.ones_like(residuals)
