"""Unknown factors on the noise of tilt and clearance: their prior, and a grid to integrate over.

A sensor is hardly ever better than the robot says of it, and may well be worse. So the prior of a
factor's logarithm is a normal distribution in two pieces: narrow below 0, the announced noise, and
wide above. Were less noise as likely as more, lengths that happen to fit few readings well would
be taken to be known better than they are.

The grid is the trapezoidal rule on the logarithms: for densities as smooth as these its error
vanishes as soon as the steps are not much wider than the density itself, which narrows with every
reading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.noise_family import SCALE_INFORMATION
from estimator.posterior.model.special import logsumexp

_LESS: Final = 0.15  # standard deviations of the prior, of logarithms below 0
_MORE: Final = 0.5  # and above
_REACH: Final = (1.2, 2.0)  # of the grid, below 0 and above
_STEP: Final = 1.5  # standard deviations of the posterior


def log_prior(scales: Array) -> Array:
    """Log-density of the prior of each factor's logarithm, to a constant; of any shape."""
    density: Array = -0.5 * (scales / np.where(scales < 0, _LESS, _MORE)) ** 2
    return density


def drawn_scales(shape: int | tuple[int, ...], rng: np.random.Generator) -> Array:
    """Logarithms of factors, drawn from the prior."""
    away = np.abs(rng.normal(size=shape))
    below = rng.random(shape) < _LESS / (_LESS + _MORE)
    return np.where(below, -_LESS, _MORE) * away


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
    step = _STEP / math.sqrt(SCALE_INFORMATION * readings + _LESS**-2)
    below, above = (math.ceil(reach / step) for reach in _REACH)
    nodes: Array = step * np.arange(-below, above + 1, dtype=float)
    log_density = log_prior(nodes)
    log_weights: Array = log_density - logsumexp(log_density)
    return nodes, log_weights
