"""The grid over which unknown factors on the noise of tilt and clearance are integrated.

The trapezoidal rule on the logarithms of the factors: for a density as smooth as this one its error
vanishes as soon as the steps are not much wider than the density itself, which narrows with every
reading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.special import logsumexp
from estimator.posterior.model.unknowns import SCALE_SPREAD

_REACH: Final = 4.0  # standard deviations of the prior, to either side
_STEP: Final = 1.5  # standard deviations of the posterior


@dataclass(frozen=True, kw_only=True)
class NoiseFactors:
    """The nodes of the grid and their weights.

    Attributes:
        tilt: Logarithms of the factors on tilt's noise, shape (t,).
        clearance: On clearance's, shape (c,).
        both: All pairs, tilt by tilt, shape (t · c, 2).
        log_weights: Of the pairs, the prior's density included, shape (t · c,).
    """

    tilt: Array
    clearance: Array
    both: Array
    log_weights: Array

    @classmethod
    def known_by(cls, tilts: float, clearances: float) -> Self:
        """A grid that is fine enough for so many readings of each."""
        (tilt, of_tilt), (clearance, of_clearance) = _axis(tilts), _axis(clearances)
        return cls(
            tilt=tilt,
            clearance=clearance,
            both=np.stack(np.meshgrid(tilt, clearance, indexing="ij"), -1).reshape(-1, 2),
            log_weights=np.add.outer(of_tilt, of_clearance).ravel(),
        )


def _axis(readings: float) -> tuple[Array, Array]:
    """Nodes and the logarithms of their weights, which add up to 1."""
    step = _STEP / math.sqrt(2 * readings + SCALE_SPREAD**-2)
    half = math.ceil(_REACH * SCALE_SPREAD / step)
    nodes: Array = step * np.arange(-half, half + 1, dtype=float)
    log_density: Array = -0.5 * (nodes / SCALE_SPREAD) ** 2
    log_weights: Array = log_density - logsumexp(log_density)
    return nodes, log_weights
