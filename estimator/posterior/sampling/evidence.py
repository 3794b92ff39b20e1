"""Approximate evidences of sets of attachments: Laplace's approximation at their best lengths.

They decide which sets are weighed (``weighing``).
"""

from __future__ import annotations

from estimator.body.morphology import Array
from estimator.posterior.model.gauss_newton import Free, GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Predictor


class EvidenceEstimator:
    """Approximates evidences of sets of attachments.

    Args:
        predictor: Computes readings.
        likelihood: Of the observations.

    Attributes:
        predictor: As above, like ``likelihood``.
    """

    def __init__(self, predictor: Predictor, likelihood: Likelihood) -> None:
        self.predictor, self.likelihood = predictor, likelihood
        self._solver = GaussNewton(predictor, likelihood)

    def fits(self, values: Array) -> Array:
        """Log-likelihoods with the noise factors integrated out, shape (n,).

        Args:
            values: Points, shape (n, size).
        """
        return self._solver.fits(values)

    def guess(self, values: Array) -> Array:
        """Laplace's approximation of the log-evidence, shape (n,).

        Args:
            values: The best point of each set, shape (n, size).
        """
        fits, half_volumes = self.fits(values), self._solver.half_volumes(values)
        guesses: Array = fits + half_volumes + self.predictor.unknowns.log_prior(values)
        return guesses

    def as_built(self, values: Array) -> tuple[Array, Array]:
        """The best points with narrow components open, shape (n, size), and their evidences.

        Args:
            values: A point of each set, shape (n, size).
        """
        unknowns = self.predictor.unknowns
        narrow = {row: one.narrow for row, one in enumerate(unknowns.table) if one.narrow}
        free = Free.with_parameters(unknowns, [narrow] * len(values))
        points, fits = self._solver.polished(values, free=free)
        guesses = fits + self._solver.half_volumes(points, free) + unknowns.log_prior(points)
        return points, guesses
