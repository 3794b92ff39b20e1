"""Information gained by an interaction about the body, in bits."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.likelihood import Likelihood, Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.special import logsumexp
from estimator.posterior.model.unknowns import Columns, Predictor
from estimator.posterior.posterior import Posterior, systematic

SAMPLES: Final = 200
"""Among so many samples information is measured: at most their number's logarithm."""


def information_gained(
    before: Posterior, after: Posterior, predictor: Predictor, data: SensorData, noise: Noise
) -> float:
    """Information that the last interaction gave about the body, bits.

    Each sample of the posterior is compared with samples of the previous posterior by the
    density of what was observed, as the expected information gain does it with predicted readings.
    If the posteriors are right the mean over interactions is therefore the same.

    Args:
        before: The posterior before the last interaction.
        after: The one after it.
        predictor: Computes readings.
        data: The observations of all interactions.
        noise: Sensor noise.
    """
    last = data[-1:]
    likelihood = Likelihood(last, noise)

    def fits(posterior: Posterior, rows: Columns) -> Array:
        return likelihood.normalised(predictor, posterior.values[rows], posterior.scales[rows])[
            :, 0
        ]

    others = fits(before, systematic(before.weights, SAMPLES - 1, 0.5))
    own = fits(after, np.arange(len(after.values)))
    mean = np.logaddexp(own, logsumexp(others)) - math.log(1 + len(others))
    return float(after.weights @ (own - mean)) / math.log(2)
