"""The noise of sensors: its size, the family of its distribution, and unknown factors on its size.

*The family* (here normal). Everything that depends on the family is in this file: density and
tail, which ``mixture`` compiles; draws, for predicted readings, and the densities of these under
many predictions at once; the weight of a residual in a Gauss-Newton step; and what a right body
loses relative to a perfect fit. The distribution is symmetric about 0 and highest there.

*Factors* on the noise of tilt and clearance. A sensor is hardly ever better than the robot says of
it, and may well be worse. So the prior of a factor's logarithm is a normal distribution in two
pieces: narrow below 0, the announced noise, and wide above. Were less noise as likely as more,
lengths that happen to fit few readings well would be taken to be known better than they are. The
factors are integrated over by the trapezoidal rule on the logarithms: for densities as smooth as
these its error vanishes as soon as the steps are not much wider than the density itself, which
narrows with every reading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple, Self

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.sensor_data import MODEL_CLEARANCE, MODEL_TILT, SCALED
from estimator.posterior.model.special import logsumexp, ndtr
from protocol.wire.capabilities import Capabilities

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
    """Logarithm of the density relative to that at 0; to be compiled, like ``log_above``."""
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


def log_tail(residuals: Array) -> Array:
    """``log_above`` of arrays; residuals beyond ``_FAR``, where it is negligible, count as that."""
    logs: Array = np.log(ndtr(-np.minimum(residuals, _FAR)))
    return logs


def read_factors(values: Array) -> Array:
    """Factors of readings, of any shape, for ``predicted_factors``; in a last dimension of 3."""
    return np.stack([values**2, values, np.ones_like(values)], axis=-1)


def predicted_factors(values: Array, noise: Array) -> Array:
    """Factors whose inner products with ``read_factors`` are log-densities: all pairs at once."""
    half = np.broadcast_to(-0.5 / noise**2, values.shape)
    peak = LOG_PEAK - np.log(noise)
    return np.stack([half, -2 * half * values, half * values**2 + peak], axis=-1)


def drawn(shape: int | tuple[int, ...], rng: np.random.Generator) -> Array:
    """Random deviations in units of the noise, of that shape."""
    return rng.normal(size=shape)


def step_weight(residuals: Array) -> Array:
    """Weight of residuals in iteratively reweighted least squares, of any shape.

    That is minus the slope of ``log_shape``, divided by the residual.
    """
    return np.ones_like(residuals)


class Noise(NamedTuple):
    """Standard deviations of the sensors about a perfect model's readings, and shares of outliers.

    A tuple, as compiled functions take it.

    Attributes:
        tilt: Standard deviation of each tilt, rad.
        clearance: Standard deviation of clearance, m.
        touch: Probability that a touch bit is wrong.
        outlier: Share of the interactions that do not end in the pose predicted.
        nearby: Share of these that end beside that pose; the readings of the others say nothing.
    """

    tilt: float
    clearance: float
    touch: float = 0.02
    outlier: float = 0.05
    nearby: float = 0.5

    @classmethod
    def announced(cls, capabilities: Capabilities) -> Noise:
        """Noise that a robot announces, together with what a model itself cannot know.

        A joint that is not where its servo measures it leans the body by as much at most, and lifts
        it by that times half its size.
        """
        tilt, clearance = (capabilities.sensor(name) for name in ("tilt", "clearance"))
        joint = max(joint.measured_noise or 0.0 for joint in capabilities.joints)
        lift = joint * max(capabilities.base_size) / 2
        return cls(
            tilt=math.hypot(tilt.noise if tilt else 0.0, MODEL_TILT, joint),
            clearance=math.hypot(clearance.noise if clearance else 0.0, MODEL_CLEARANCE, lift),
        )

    def widened(self, factors: Array) -> Noise:
        """This noise, with factors, shape (2,), on that of the modalities ``SCALED``."""
        wide = (self.of(name) * factor for name, factor in zip(SCALED, factors, strict=True))
        return self._replace(**dict(zip(SCALED, map(float, wide), strict=True)))

    def of(self, modality: str) -> float:
        """Standard deviation of one modality; of touch the probability of a wrong bit."""
        figure: float = getattr(self, modality)
        return figure


_SPREAD_BELOW: Final = 0.15  # standard deviation of the prior of a factor's logarithm, below 0
_SPREAD_ABOVE: Final = 0.5  # and above 0
_REACH: Final = (1.2, 2.0)  # how far the grid reaches below 0, and above
_GRID_STEP: Final = 1.5  # step of the grid, in standard deviations of the posterior


def log_prior(scales: Array) -> Array:
    """Log-density of the prior of each factor's logarithm, to a constant; of any shape."""
    return -0.5 * (scales / np.where(scales < 0, _SPREAD_BELOW, _SPREAD_ABOVE)) ** 2


def drawn_scales(shape: int | tuple[int, ...], rng: np.random.Generator) -> Array:
    """Logarithms of factors, drawn from the prior."""
    sizes = np.abs(rng.normal(size=shape))
    below = rng.random(shape) < _SPREAD_BELOW / (_SPREAD_BELOW + _SPREAD_ABOVE)
    return np.where(below, -_SPREAD_BELOW, _SPREAD_ABOVE) * sizes


@dataclass(frozen=True, kw_only=True)
class NoiseFactors:
    """The nodes of the grid of noise factors, and their weights.

    Attributes:
        tilt: Logarithms of the factors on tilt's noise, shape (t,).
        clearance: Logarithms of the factors on clearance's noise, shape (c,).
        both: All pairs of these, tilt by tilt, shape (t · c, 2).
        log_weights: Logarithms of the pairs' weights, the prior's density included, shape (t · c,).
        weights: Weights of the pairs, which add up to 1, shape (t, c).
    """

    tilt: Array
    clearance: Array
    both: Array
    log_weights: Array
    weights: Array

    @classmethod
    def known_by(cls, tilts: float, clearances: float) -> Self:
        """A grid that is fine enough for so many readings of tilt and of clearance."""
        (tilt, of_tilt), (clearance, of_clearance) = _axis(tilts), _axis(clearances)
        log_weights = np.add.outer(of_tilt, of_clearance)
        return cls(
            tilt=tilt,
            clearance=clearance,
            both=np.stack(np.meshgrid(tilt, clearance, indexing="ij"), -1).reshape(-1, 2),
            log_weights=log_weights.ravel(),
            weights=np.exp(log_weights),
        )


def _axis(readings: float) -> tuple[Array, Array]:
    """Nodes of the grid of one factor, and logarithms of their weights, which add up to 1."""
    step = _GRID_STEP / math.sqrt(SCALE_INFORMATION * readings + _SPREAD_BELOW**-2)
    below, above = (math.ceil(reach / step) for reach in _REACH)
    nodes: Array = step * np.arange(-below, above + 1, dtype=float)
    log_density = log_prior(nodes)
    log_weights: Array = log_density - logsumexp(log_density)
    return nodes, log_weights
