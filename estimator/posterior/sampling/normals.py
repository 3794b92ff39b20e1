"""Normal distributions around peaks of the posterior, by which particles are drawn and moved."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.posterior.model.gauss_newton import PRIOR
from estimator.posterior.model.unknowns import Columns

_LEAST_DEVIATION: Final = 0.02  # least standard deviation of a length around a peak, of its range
_LEAST_VARIANCE: Final = 1e-10  # least variance of particles
_LOG_ROOT: Final = 0.5 * math.log(2 * math.pi)


@dataclass(frozen=True, kw_only=True)
class Normals:
    """Normal distributions around p peaks of each of g sets of attachments, in d dimensions.

    Attributes:
        mean: Means, shape (g, p, d).
        root: Cholesky root of each covariance, shape (g, p, d, d).
        inverse: Inverse of each root, shape (g, p, d, d).
    """

    mean: Array
    root: Array
    inverse: Array

    @classmethod
    def around(cls, peaks: Array, precision: Array, normal: Flags, counts: float) -> Normals:
        """Normal approximations of the posterior at its peaks, with the readings counting less.

        Args:
            peaks: Peaks of each set, shape (g, p, d).
            precision: Precision of lengths and θ there, the prior's included, shape (g, p, d, d).
            normal: Which dimensions are θ, shape (d,); they come last.
            counts: Share of the readings' information that counts.
        """
        prior = np.diag(np.where(normal, 1.0, PRIOR))
        flatter = prior + counts * (precision - prior)
        covariance = np.asarray(np.linalg.inv(flatter))
        covariance += np.diag(np.where(normal, 0.0, _LEAST_DEVIATION**2))
        theta = np.where(normal, peaks, 0.0)  # only θ is drawn to its prior's mean
        climb = counts * (precision @ theta[..., None])
        mean = np.where(normal, 0.0, peaks) + np.linalg.solve(flatter, climb)[..., 0]
        return cls.of(mean, covariance)

    @classmethod
    def with_covariance_of(cls, x: Array) -> Normals:
        """Distributions with the mean and covariance of each set's particles, shape (g, n, d).

        The fewer particles, the more its correlations are shrunk.
        """
        _, count, size = x.shape
        mean, axes = x.mean(axis=1, keepdims=True), np.arange(size)
        covariance = np.swapaxes(x - mean, 1, 2) @ (x - mean) / count
        variance = covariance[:, axes, axes] + _LEAST_VARIANCE
        covariance *= count / (count + size)
        covariance[:, axes, axes] = variance
        return cls.of(mean, covariance[:, None])

    @classmethod
    def of(cls, mean: Array, covariance: Array) -> Normals:
        """Distributions with these means, shape (g, p, d), and covariances, shape (g, p, d, d)."""
        root = np.asarray(np.linalg.cholesky(covariance))
        return cls(mean=mean, root=root, inverse=np.asarray(np.linalg.inv(root)))

    def coloured(self, normal: Array) -> Array:
        """Standard normal draws, shape (g, n, d), made draws around each peak, (p, g, n, d)."""
        points = self.mean[:, :, None] + normal[:, None] @ np.swapaxes(self.root, 2, 3)
        return np.swapaxes(points, 0, 1)

    def whitened(self, x: Array) -> Array:
        """Inverse of ``coloured``: points (g, n, d), made standard normal draws (p, g, n, d)."""
        draws = (x[:, None] - self.mean[:, :, None]) @ np.swapaxes(self.inverse, 2, 3)
        return np.swapaxes(draws, 0, 1)

    def log_densities(self, x: Array, groups: Columns | slice = slice(None)) -> Array:
        """Log-densities (p, groups, n) by each peak, at points (groups, n, d) of some sets."""
        chosen = Normals(**{name: array[groups] for name, array in vars(self).items()})
        log_root = np.log(np.diagonal(chosen.root, axis1=2, axis2=3)).sum(axis=2)
        log_densities: Array = log_normal(chosen.whitened(x)) - log_root.T[..., None]
        return log_densities


def log_normal(theta: Array) -> Array:
    """Logarithm of the standard normal density of the vectors in the last axis."""
    density: Array = -0.5 * np.sum(theta**2, axis=-1) - _LOG_ROOT * theta.shape[-1]
    return density
