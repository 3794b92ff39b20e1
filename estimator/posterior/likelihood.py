"""How likely an interaction is, given a body.

A mixture, so that one pose can cost a body only so much. For one interaction with readings y and a
body that predicts its pose::

    p(y | body) = (1 - e) N(tilt; s_t) N(clearance; s_c) Π Bernoulli(touch) + e p0(y)

p0 is what a robot might feel anywhere: each tilt uniform over ±90°, clearance uniform over the
sensor's range, touch bits even. A pose that the model cannot predict (undecided, or a simulation
that cannot be believed) leaves only p0. A clearance at the end of the sensor's range says that the
ground lies beyond: a tail integral. Missing readings are left out.

A body's predictions enter through five numbers per interaction, its *misfits*, whatever the noise:
so the noise can be widened, as it is on the hotter levels of a search, without a simulation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import expit, log_ndtr

from estimator.body.morphology import Array
from estimator.physics.base import Flags, Readings
from estimator.posterior.unknowns import Columns, Predictor
from estimator.readings.observation import Observation
from protocol.wire.capabilities import Capabilities

TILT: Final = 0  # sum of the squared tilt residuals, rad²
CLEARANCE: Final = 1  # observed minus predicted, m
WRONG: Final = 2  # touch bits that differ
DOUBTFUL: Final = 3  # touch bits of which the model is not sure
SILENT: Final = 4  # 1 where the model predicts nothing
MISFITS: Final = 5

_MODEL_TILT: Final = math.radians(0.2)  # what a model of capsules cannot know
_MODEL_CLEARANCE: Final = 0.8e-3
_BEYOND: Final = 0.1  # share of the poses anywhere whose clearance lies beyond the range
_WORST_TOUCH: Final = 0.4  # chance of a wrong bit on the hottest levels


@dataclass(frozen=True, kw_only=True)
class Noise:
    """How far readings stray from a perfect model's.

    Attributes:
        tilt: Standard deviation of each tilt, rad.
        clearance: Standard deviation, m.
        touch: Probability that a touch bit is wrong.
        outlier: Share of the interactions whose readings say nothing about the body.
    """

    tilt: float
    clearance: float
    touch: float = 0.02
    outlier: float = 0.05

    @classmethod
    def announced(cls, capabilities: Capabilities) -> Noise:
        """What a robot says of its sensors, with what a model itself cannot know."""
        tilt, clearance = (capabilities.sensor(name) for name in ("tilt", "clearance"))
        return cls(
            tilt=math.hypot(tilt.noise if tilt else 0.0, _MODEL_TILT),
            clearance=math.hypot(clearance.noise if clearance else 0.0, _MODEL_CLEARANCE),
        )


@dataclass(frozen=True, kw_only=True)
class SensorData:
    """What a robot felt, as arrays over k interactions.

    Attributes:
        programs: Angles that the motors took, rad, shape (k, motors).
        touch: 0 or 1, NaN where missing, shape (k, s).
        tilt: rad, NaN where missing, shape (k, 2).
        clearance: m, NaN where missing, shape (k,).
        beyond: The ground lay beyond the sensor's range, shape (k,).
        cap: The sensor's range, m.
    """

    programs: Array
    touch: Array
    tilt: Array
    clearance: Array
    beyond: Flags
    cap: float

    @classmethod
    def of(
        cls, observations: Sequence[Observation], modalities: Sequence[str], cap: float
    ) -> SensorData:
        """Collects the readings of the modalities that count."""
        items = [item.as_arrays() for item in observations]
        touch = np.array([item.touch for item in items])
        tilt = np.array([item.tilt for item in items])
        clearance = np.array([item.clearance for item in items])
        for name, values in (("touch", touch), ("tilt", tilt), ("clearance", clearance)):
            if name not in modalities:
                values[...] = np.nan
        return cls(
            programs=np.array([item.angles for item in items]),
            touch=touch,
            tilt=tilt,
            clearance=clearance,
            beyond=np.array([item.clearance_saturated for item in observations])
            & ~np.isnan(clearance),
            cap=cap,
        )

    def __len__(self) -> int:
        return len(self.clearance)

    def misfits(self, readings: Readings, turns: Columns) -> Array:
        """The misfits of n readings, each in one of the interactions.

        Args:
            readings: Of n bodies.
            turns: Which interaction each is of, shape (n,).

        Returns:
            Shape (n, 5).
        """
        values = np.empty((len(turns), MISFITS))
        values[:, TILT] = np.nansum((self.tilt[turns] - readings.tilt) ** 2, axis=1)
        residual = np.nan_to_num(self.clearance[turns] - readings.clearance)
        residual[readings.saturated & self.beyond[turns]] = -np.inf
        values[:, CLEARANCE] = residual
        touch = self.touch[turns]
        felt = ~np.isnan(touch)
        values[:, WRONG] = np.sum(
            felt & ~readings.touch_doubtful & (touch != readings.touch), axis=1
        )
        values[:, DOUBTFUL] = np.sum(felt & readings.touch_doubtful, axis=1)
        values[:, SILENT] = readings.undecided | ~readings.valid
        return values

    def residuals(self, readings: Readings, turns: Columns) -> Array:
        """Observed minus predicted tilt (rad) and clearance (m), shape (n, 3); 0 where unknown."""
        clearance = self.clearance[turns] - readings.clearance
        clearance[self.beyond[turns]] = 0.0
        return np.nan_to_num(np.column_stack([self.tilt[turns] - readings.tilt, clearance]))

    def misfits_of(self, predictor: Predictor, values: Array) -> Array:
        """The misfits of n points of the cube in every interaction, shape (n, k, 5)."""
        readings = predictor.read_all(values, self.programs)
        turns = np.tile(np.arange(len(self)), len(values))
        return self.misfits(readings, turns).reshape(len(values), len(self), MISFITS)


class Likelihood:
    """The mixture of some interactions, for bodies of which the misfits are known.

    Args:
        data: What the robot felt.
        noise: How far readings stray.
    """

    def __init__(self, data: SensorData, noise: Noise):
        self._noise = noise
        self._beyond = data.beyond
        self._tilts = np.sum(~np.isnan(data.tilt), axis=1)
        self._bits = np.sum(~np.isnan(data.touch), axis=1)
        self._ranged = ~np.isnan(data.clearance)
        anywhere = self._tilts * -math.log(math.pi) + self._bits * math.log(0.5)
        anywhere += np.where(self._ranged & self._beyond, math.log(_BEYOND), 0.0)
        anywhere += np.where(self._ranged & ~self._beyond, math.log((1 - _BEYOND) / data.cap), 0.0)
        self._outlier = math.log(noise.outlier) + anywhere
        self.sigmas = np.array([noise.tilt, noise.tilt, noise.clearance])

    def inlier_share(
        self, misfits: Array, width: float = 1.0, scales: Array | None = None
    ) -> Array:
        """Probability that each interaction is no outlier, shape (n, k)."""
        count = len(misfits)
        factors = np.zeros((count, 2)) if scales is None else scales
        inlier, outlier = self.terms(misfits, np.full(count, width), factors)
        share: Array = expit(inlier - outlier)
        return share

    def of(
        self, misfits: Array, width: Array, scales: Array, turns: Columns | None = None
    ) -> Array:
        """Log-likelihood of each body in each interaction.

        Args:
            misfits: Shape (n, k, 5).
            width: Factor on all standard deviations, shape (n,): a level of the search.
            scales: Logarithms of the factors on tilt's and clearance's noise, shape (n, 2).
            turns: Which interactions the columns are, where not all in order, shape (n, k).

        Returns:
            Shape (n, k).
        """
        inlier, outlier = self.terms(misfits, width, scales, turns)
        return np.logaddexp(inlier, outlier)

    def terms(
        self, misfits: Array, width: Array, scales: Array, turns: Columns | None = None
    ) -> tuple[Array, Array]:
        """Logarithms of the mixture's two terms, each of shape (n, k)."""
        take = slice(None) if turns is None else turns
        tilts, bits, beyond = self._tilts[take], self._bits[take], self._beyond[take]
        ranged, outlier = self._ranged[take], self._outlier[take]
        noise = self._noise
        wide = np.asarray(width)[:, None]
        tilt = noise.tilt * wide * np.exp(scales[:, :1])
        clearance = noise.clearance * wide * np.exp(scales[:, 1:2])
        wrong = np.minimum(noise.touch * wide, _WORST_TOUCH)
        inlier = math.log1p(-noise.outlier) - misfits[..., TILT] / (2 * tilt**2)
        inlier = inlier - tilts * np.log(tilt * math.sqrt(2 * math.pi))
        residual = misfits[..., CLEARANCE]
        with np.errstate(invalid="ignore"):
            density = -0.5 * (residual / clearance) ** 2 - np.log(
                clearance * math.sqrt(2 * math.pi)
            )
            if beyond.any():
                density = np.where(beyond, log_ndtr(-residual / clearance), density)
        inlier = inlier + np.where(ranged, density, 0.0)
        doubtful, misses = misfits[..., DOUBTFUL], misfits[..., WRONG]
        right = bits - doubtful - misses
        inlier = inlier + right * np.log1p(-wrong) + misses * np.log(wrong)
        inlier = inlier + doubtful * math.log(0.5)
        inlier = np.where(misfits[..., SILENT] > 0, -np.inf, inlier)
        return inlier, np.broadcast_to(outlier, inlier.shape)
