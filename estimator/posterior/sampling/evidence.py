"""How probable sets of attachments are, roughly: Laplace's approximation at their best lengths.

By it those are chosen that are weighed (``weighing``).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor


class EvidenceEstimator:
    """Guesses the evidence of sets of attachments on robots that are as stated.

    Args:
        predictor: Computes readings.
        data: The observations.
        likelihood: Of ``data``.
    """

    def __init__(self, predictor: Predictor, data: SensorData, likelihood: Likelihood) -> None:
        self._predictor = predictor
        self._solver = GaussNewton(predictor, data, likelihood)
        self._fits: dict[bytes, float] = {}
        self._half_volumes: dict[bytes, float] = {}

    def fits(self, values: Array) -> Array:
        """Log-likelihoods with the noise factors integrated out, shape (n,).

        Args:
            values: Points, shape (n, size). Those that were asked for before cost nothing.
        """
        return self._looked_up(self._fits, values, self._fits_of)

    def guess(self, values: Array) -> Array:
        """Laplace's approximation of the evidence, to tell which sets are worth more; shape (n,).

        Args:
            values: The best point of each set, shape (n, size); see ``fits``.
        """
        half_volumes = self._looked_up(self._half_volumes, values, self._half_volumes_of)
        prior = self._predictor.unknowns.log_prior(values)
        guesses: Array = self.fits(values) + np.minimum(0.0, half_volumes) + prior
        return guesses

    def _looked_up(
        self, known: dict[bytes, float], values: Array, compute: Callable[[Array], Array]
    ) -> Array:
        points = [value.tobytes() for value in values]
        fresh = [row for row, point in enumerate(points) if point not in known]
        if fresh:
            numbers = compute(values[fresh]).tolist()
            known.update(zip((points[row] for row in fresh), numbers, strict=True))
        return np.array([known[point] for point in points])

    def _fits_of(self, values: Array) -> Array:
        return self._solver.fits(values)

    def _half_volumes_of(self, values: Array) -> Array:
        precision = self._solver.slopes(values).precision
        volume = precision.shape[-1] * math.log(2 * math.pi) - np.linalg.slogdet(precision)[1]
        return np.asarray(0.5 * volume)
