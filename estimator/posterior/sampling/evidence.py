"""Approximate evidences of sets of attachments: Laplace's approximation at their best lengths.

They decide which sets are weighed (``weighing``).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np

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
        self._known: defaultdict[str, dict[bytes, Any]] = defaultdict(dict)

    def fits(self, values: Array) -> Array:
        """Log-likelihoods with the noise factors integrated out, shape (n,).

        Args:
            values: Points, shape (n, size). Results are kept for the next time.
        """
        return self._looked_up("fits", values, self._solver.fits)

    def guess(self, values: Array) -> Array:
        """Laplace's approximation of the log-evidence, shape (n,).

        Args:
            values: The best point of each set, shape (n, size); see ``fits``.
        """
        half_volumes = self._looked_up("half volumes", values, self._solver.half_volumes)
        prior = self.predictor.unknowns.log_prior(values)
        guesses: Array = self.fits(values) + half_volumes + prior
        return guesses

    def as_built(self, values: Array) -> tuple[Array, Array]:
        """The best points with narrow components open, shape (n, size), and their evidences.

        Args:
            values: A point of each set, shape (n, size). Results are kept for the next time.
        """
        both = self._looked_up("as built", values, self._as_built)
        return both[:, :-1], both[:, -1]

    def _as_built(self, values: Array) -> Array:
        """These points, and in the last column the evidences, shape (n, size + 1)."""
        unknowns = self.predictor.unknowns
        narrow = {row: one.narrow for row, one in enumerate(unknowns.table) if one.narrow}
        free = Free.with_parameters(unknowns, [narrow] * len(values))
        points, fits = self._solver.polished(values, free=free)
        guesses = fits + self._solver.half_volumes(points, free) + unknowns.log_prior(points)
        return np.column_stack([points, guesses])

    def _looked_up(self, what: str, values: Array, compute: Callable[[Array], Array]) -> Array:
        """Results for each of n points, row by row; those computed before are looked up."""
        known, keys = self._known[what], [value.tobytes() for value in values]
        fresh = [row for row, key in enumerate(keys) if key not in known]
        if fresh:
            known.update(zip((keys[row] for row in fresh), compute(values[fresh]), strict=True))
        return np.array([known[key] for key in keys])
