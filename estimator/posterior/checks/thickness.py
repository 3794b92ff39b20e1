"""Would parts of another thickness explain the readings clearly better?

A radius that a problem states wrongly can be made up for by lengths: readings stay explained, and
every length is off by more than its interval. Which radius the readings themselves speak for is
therefore looked at, where they speak for any: movements that bend legs little cannot tell.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.likelihood import Likelihood, Noise, SensorData
from estimator.posterior.model.slopes import Lengths
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Posterior

_FACTORS: Final = (0.35, 0.5, 0.7, 1.4, 2.0, 2.8)
_CLEARLY_BETTER: Final = 2.0  # nats, the interaction that speaks most for it left out
_STARTS: Final = 12


def better_thickness(
    posterior: Posterior, predictor: Predictor, data: SensorData, noise: Noise
) -> float | None:
    """Factor on the radii of all parts by which the readings are explained clearly better, if any.

    Lengths are fitted anew for each factor, from the best body and some samples. The interaction
    that gains most does not count, since one that ended elsewhere may gain much by accident.

    Args:
        posterior: With the problem's radii.
        predictor: Likewise.
        data: What the robot felt.
        noise: How far readings stray.
    """
    every = max(1, len(posterior.values) // _STARTS)
    starts = np.vstack([posterior.modes[0].point, posterior.values[::every]])
    as_stated = _best_fit(starts, predictor, data, noise)
    best, factor_of_best = _CLEARLY_BETTER, None
    for factor in _FACTORS:
        gains = _best_fit(starts, predictor.with_thickness(factor), data, noise) - as_stated
        gain = float(gains.sum() - gains.max())
        if gain > best:
            best, factor_of_best = gain, factor
    return factor_of_best


def _best_fit(starts: Array, predictor: Predictor, data: SensorData, noise: Noise) -> Array:
    """Log-likelihood of each interaction under the lengths that fit best, shape (k,)."""
    likelihood = Likelihood(data, noise)
    values, fits = Lengths(predictor, data, likelihood).polished(starts)
    misfits = likelihood.misfits_of(predictor, values[[np.argmax(fits)]])
    best: Array = likelihood.of(misfits, np.ones(1), np.zeros((1, 2)))[0]
    return best
