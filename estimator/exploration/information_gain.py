"""What a motor program would tell: expected information gain by nested Monte Carlo.

A reading is drawn from each sample's prediction, noise included, and what it would tell about the
group of samples that its sample belongs to is ``log p(y | group) - log p(y)``, under the mixture by
which bodies are judged. So a program that separates bodies only by what cannot be measured, or in
poses that the models cannot predict, is worth nothing. With
every sample a group of its own this is the information about the body as a whole; with samples
grouped by what they say of one leg's side, it is the information about that side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.exploration.gain_kernel import gains
from estimator.parallel.executors import Threads
from estimator.physics.base import Readings
from estimator.posterior.model.likelihood import Noise, apart
from estimator.posterior.model.noise import drawn
from estimator.posterior.model.sensor_data import DENSITIES, ReadingCounts


@dataclass(frozen=True, kw_only=True)
class Predictions:
    """What n samples feel in each of p programs.

    Attributes:
        touch: Touch bits, shape (p, n, s).
        doubtful: Whether a touch bit is undecided, shape (p, n, s).
        tilt: rad, shape (p, n, 2).
        clearance: m, shape (p, n).
        beyond: The ground lies beyond the sensor's range, shape (p, n).
        no_prediction: The model cannot predict its pose, shape (p, n).
    """

    touch: Flags
    doubtful: Flags
    tilt: Array
    clearance: Array
    beyond: Flags
    no_prediction: Flags

    @classmethod
    def of(cls, readings: Readings, samples: int) -> Predictions:
        """From readings of all samples in one program and the next."""
        shape = (len(readings) // samples, samples)
        return cls(
            touch=readings.touch.reshape(*shape, -1),
            doubtful=readings.touch_doubtful.reshape(*shape, -1),
            tilt=readings.tilt.reshape(*shape, 2),
            clearance=readings.clearance.reshape(shape),
            beyond=readings.saturated.reshape(shape),
            no_prediction=(readings.undecided | ~readings.valid).reshape(shape),
        )


class InformationGain:
    """Computes information gains under one robot's noise.

    Args:
        noise: Sensor noise.
        cap: Range of the distance sensor, m.
        modalities: Sensors that count.
        threads: Share out the programs; one by default.
    """

    def __init__(
        self, noise: Noise, cap: float, modalities: Sequence[str], threads: Threads | None = None
    ) -> None:
        self._noise = noise
        self._threads = threads or Threads(1)
        self._cap = cap
        self._modalities = tuple(modalities)

    def apart(self, one: Readings, other: Readings) -> Flags:
        """Which of n readings are plainly not of the same pose, shape (n,)."""
        return apart(one, other, self._noise)

    def of(
        self,
        predictions: Predictions,
        scales: Array,
        groups: NDArray[np.int64],
        rng: np.random.Generator,
        *,
        draws: int,
    ) -> Array:
        """Expected information of each program, in bits, shape (p,).

        Args:
            predictions: What equally likely samples feel.
            scales: Logarithms of their noise factors, shape (n, 2).
            groups: Group of each sample, shape (n,).
            rng: Draws the noise, which is the same for all programs.
            draws: Readings per program; one sample after the other.
        """
        touch, tilt, clear = (name in self._modalities for name in ("touch", "tilt", "clearance"))
        sensors = slice(None if touch else 0)
        noise_draws = drawn((draws, 3), rng)
        uniforms = rng.random((draws, 1 + predictions.touch.shape[2]))
        if not tilt:
            noise_draws[:, :2] = 0.0
        result = np.zeros(len(predictions.tilt))
        laid_out = np.ascontiguousarray  # the kernel would be compiled for each layout
        arguments = (
            laid_out(predictions.touch[..., sensors]),
            laid_out(predictions.doubtful[..., sensors]),
            laid_out(predictions.tilt) if tilt else np.zeros_like(predictions.tilt),
            laid_out(predictions.clearance),
            laid_out(predictions.beyond),
            laid_out(predictions.no_prediction),
            laid_out(scales),
            self._noise.spread,
            self._anywhere(predictions.touch.shape[2]),
            self._cap,
            2.0 if tilt else 0.0,
            clear,
            np.ascontiguousarray(groups, dtype=np.int64),
            noise_draws,
            uniforms,
            result,
        )
        self._threads.share_out(
            lambda start, end: gains(start, end, *arguments), len(result), fewest=1
        )
        return result / math.log(2)

    def _anywhere(self, bits: int) -> Array:
        """Density of a reading anywhere times the share of outliers: within the range, beyond."""
        beyond = np.array([False, True])
        logs = np.full(2, math.log(self._noise.outlier))
        for name, count in (("touch", bits), ("tilt", 2), ("clearance", 1)):
            if name in self._modalities:
                known = ReadingCounts(count=np.full(2, count), beyond=beyond)
                logs += DENSITIES[name].log_anywhere(known, self._cap)
        density: Array = np.exp(logs)
        return density
