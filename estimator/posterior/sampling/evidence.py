"""How probable sets of attachments are, roughly: Laplace's approximation at their best lengths.

By it those are chosen that are weighed (``weighing``).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.gauss_newton import Free, GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Predictor


class EvidenceEstimator:
    """Guesses the evidence of sets of attachments.

    Args:
        predictor: Computes readings.
        likelihood: Of the observations.

    Attributes:
        predictor: As above, like ``likelihood``.
    """

    def __init__(self, predictor: Predictor, likelihood: Likelihood) -> None:
        self.predictor, self.likelihood = predictor, likelihood
        self._solver = GaussNewton(predictor, likelihood)
        self._fits: dict[bytes, float] = {}
        self._half_volumes: dict[bytes, float] = {}
        self._built: dict[bytes, tuple[Array, float]] = {}

    def fits(self, values: Array) -> Array:
        """Log-likelihoods with the noise factors integrated out, shape (n,).

        Args:
            values: Points, shape (n, size). Those that were asked for before cost nothing.
        """
        return self._looked_up(self._fits, values, self._solver.fits)

    def guess(self, values: Array) -> Array:
        """Laplace's approximation of the evidence, to tell which sets are worth more; shape (n,).

        Args:
            values: The best point of each set, shape (n, size); see ``fits``.
        """
        half_volumes = self._looked_up(self._half_volumes, values, self._solver.half_volumes)
        prior = self.predictor.unknowns.log_prior(values)
        guesses: Array = self.fits(values) + half_volumes + prior
        return guesses

    def as_built(self, values: Array) -> tuple[Array, Array]:
        """The best points of robots as people build them, shape (n, size), and their guesses.

        Args:
            values: Of each set, shape (n, size). Those that were asked for before cost nothing.
        """
        keys = [value.tobytes() for value in values]
        fresh = values[[row for row, key in enumerate(keys) if key not in self._built]]
        if len(fresh):
            table = self.predictor.unknowns.table
            narrow = {row: one.narrow for row, one in enumerate(table) if one.narrow}
            free = Free.with_parameters(self.predictor.unknowns, [narrow] * len(fresh))
            points, fits = self._solver.polished(fresh, free=free)
            guesses = fits + self._solver.half_volumes(points, free)
            guesses += self.predictor.unknowns.log_prior(points)
            known = zip(points, guesses.tolist(), strict=True)
            self._built.update(zip((value.tobytes() for value in fresh), known, strict=True))
        found = [self._built[key] for key in keys]
        return np.array([point for point, _ in found]), np.array([guess for _, guess in found])

    def _looked_up(
        self, known: dict[bytes, float], values: Array, compute: Callable[[Array], Array]
    ) -> Array:
        points = [value.tobytes() for value in values]
        fresh = [row for row, point in enumerate(points) if point not in known]
        if fresh:
            numbers = compute(values[fresh]).tolist()
            known.update(zip((points[row] for row in fresh), numbers, strict=True))
        return np.array([known[point] for point in points])
