"""Expected information gain of a motor program, by nested Monte Carlo.

A reading is drawn from each sample's prediction, noise included. Its information about the group of
samples that its sample belongs to is ``log p(y | group) - log p(y)``, under the likelihood by which
bodies are judged. So a program that separates bodies only by what cannot be measured, or in poses
that cannot be predicted, is worth nothing. With every sample a group of its own this is the
information about the whole body; with samples grouped by one leg's side, about that side.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.executors import Threads
from estimator.posterior.model.likelihood import apart
from estimator.posterior.model.noise import (
    Noise,
    drawn,
    log_tail,
    predicted_factors,
    read_factors,
)
from estimator.posterior.model.sensor_data import DENSITIES, SCALED
from estimator.readings.observation import PredictedReadings

_PAIRS: Final = 131_072  # pairs of a reading and a sample computed at once: a megabyte of densities
_LEAST_LOG: Final = -60.0  # log-density that is negligible; the exponential of less is slow


class InformationGain:
    """Computes information gains under one robot's noise.

    Args:
        noise: Sensor noise.
        cap: Range of the distance sensor, m.
        modalities: Sensors that count.
        threads: Threads that share out the programs; one by default.
    """

    def __init__(
        self, noise: Noise, cap: float, modalities: Sequence[str], threads: Threads | None = None
    ) -> None:
        self._noise = noise
        self._threads = threads or Threads(1)
        self._cap = cap
        self._modalities = tuple(modalities)

    def apart(self, one: PredictedReadings, other: PredictedReadings) -> Flags:
        """Whether n pairs of readings are of different poses, shape (n,)."""
        return apart(one, other, self._noise)

    def of(
        self,
        readings: PredictedReadings,
        scales: Array,
        groups: NDArray[np.int64],
        rng: np.random.Generator,
        *,
        draws: int,
    ) -> Array:
        """Expected information gain of each program by each grouping, bits, shape (p, k).

        Args:
            readings: Predictions of n equally likely samples, program by program, p · n rows.
            scales: Logarithms of the samples' noise factors, shape (n, 2).
            groups: Group of each sample, by each of k groupings, shape (n, k).
            rng: Draws the noise, which is the same for all programs and groupings.
            draws: Number of readings drawn per program, from one sample after the other.
        """
        predicted = readings.reshaped(len(readings) // len(scales), len(scales))
        noise, uniforms = drawn((draws, 3), rng), rng.random((draws, 1 + readings.touch.shape[1]))
        sources, outlier = np.arange(draws) % len(scales), self._noise.outlier
        shares = (1 - outlier, outlier * self._noise.nearby)
        as_predicted = np.exp(scales) * [self._noise.of(name) for name in SCALED]
        nearby = np.hypot(as_predicted, [DENSITIES[name].beside for name in SCALED])
        beside, unknown = uniforms[:, 0] < shares[1], predicted.undecided | ~predicted.valid
        spread = np.where(beside[:, None], nearby[sources], as_predicted[sources])
        beyond, read = self._drawn(predicted[:, sources], spread, noise, uniforms[:, 1:])
        far: Flags = np.any(beyond, axis=1)
        pairs = _Pairs(
            read=read,
            expected=[self._expected(predicted, spread, far) for spread in (as_predicted, nearby)],
            shares=shares,
            anywhere=self._anywhere(readings.touch.shape[1])[beyond.astype(int)][..., None],
            elsewhere=1 - self._noise.nearby,
            unknown=unknown,
            tells=(beside | (uniforms[:, 0] >= outlier)) & ~unknown[:, sources],
            alike=[(grouping[sources, None] == grouping).astype(float) for grouping in groups.T],
        )
        information = self._threads.share_out(pairs.told, len(predicted), fewest=1)
        return np.concatenate(information) / draws / math.log(2)

    def _drawn(
        self, own: PredictedReadings, spread: Array, noise: Array, uniforms: Array
    ) -> tuple[Flags, Array]:
        """Readings of each program and draw, given what their sources predict.

        Returns:
            Whether the ground lies beyond the range, shape (p, d), and factors to be multiplied by
            those of ``_expected``, shape (p, d, f).
        """
        wrong = np.where(own.touch_doubtful, 0.5, self._noise.touch)
        touch = own.touch != (uniforms < wrong)
        tilt = own.tilt + spread[:, :1] * noise[:, :2]
        height = own.clearance + spread[:, 1] * noise[:, 2]
        beyond = (own.saturated | (height >= self._cap)) & ("clearance" in self._modalities)
        factors = {
            "touch": (touch, ~touch),
            "tilt": (read_factors(tilt[..., 0]), read_factors(tilt[..., 1])),
            "clearance": (read_factors(height) * ~beyond[..., None], beyond[..., None]),
        }
        return beyond, self._of_modalities(factors)

    def _expected(self, predicted: PredictedReadings, spread: Array, far: Flags) -> Array:
        """Factors whose inner product with a row of ``_drawn`` is a log-density, shape (p, f, n).

        Args:
            predicted: Predictions of n samples in p programs.
            spread: Noise of tilt and clearance of each sample, shape (n, 2).
            far: Which programs have readings of ground beyond the range, shape (p,).
        """
        wrong = np.where(predicted.touch_doubtful, 0.5, self._noise.touch)
        touched, height = np.where(predicted.touch, 1 - wrong, wrong), predicted.clearance
        of_tilt, of_clearance = spread.T
        above = np.zeros_like(height)
        above[far] = log_tail((self._cap - height[far]) / of_clearance)
        factors = {
            "touch": (np.log(touched), np.log1p(-touched)),
            "tilt": [predicted_factors(predicted.tilt[..., angle], of_tilt) for angle in range(2)],
            "clearance": (
                predicted_factors(height, of_clearance),
                np.where(predicted.saturated, 0.0, above)[..., None],
            ),
        }
        return self._of_modalities(factors).swapaxes(1, 2)

    def _of_modalities(self, factors: Mapping[str, Sequence[Array]]) -> Array:
        arrays = [array for name in self._modalities for array in factors[name]]
        return np.concatenate(arrays, axis=-1, dtype=float)

    def narrowed(self, readings: PredictedReadings, amounts: Array) -> Array:
        """Share by which each program is expected to narrow some amounts, shape (p,).

        Compares the sums of their standard deviations before and after. Those after are of the
        residuals of a linear regression on tilt and clearance, among samples with the same touch
        readings. Samples without a prediction narrow nothing.

        Args:
            readings: As for ``of``.
            amounts: Amounts of the samples, shape (n, k), all in one unit.
        """
        touch, tilt, clear = (name in self._modalities for name in ("touch", "tilt", "clearance"))
        predicted = readings.reshaped(len(readings) // len(amounts), len(amounts))
        height = np.where(predicted.saturated, self._cap, predicted.clearance)[..., None]
        measured = np.concatenate(
            [
                predicted.tilt[..., : 2 * tilt] / self._noise.tilt,
                height[..., : int(clear)] / self._noise.clearance,
            ],
            axis=-1,
        )
        bits = predicted.touch & ~predicted.touch_doubtful & touch
        nothing = predicted.undecided | ~predicted.valid
        feet = np.where(nothing, -1, bits @ (1 << np.arange(bits.shape[-1])))
        before = float(amounts.std(axis=0, ddof=1).sum())
        left = np.zeros(len(feet))
        for program, patterns in enumerate(feet):
            for pattern in np.unique(patterns):
                rows, deviation = np.flatnonzero(patterns == pattern), before
                if pattern >= 0:
                    deviation = _deviation_left(measured[program, rows], amounts[rows], before)
                left[program] += len(rows) * deviation
        narrowed: Array = 1 - left / feet.shape[1] / before
        return narrowed

    def _anywhere(self, bits: int) -> Array:
        """Share of outliers times a reading's density in any pose: ground within the range, beyond.

        Shape (2,).
        """
        beyond = np.array([False, True])
        logs = np.full(2, math.log(self._noise.outlier))
        for name, count in (("touch", bits), ("tilt", 2), ("clearance", 1)):
            if name in self._modalities:
                logs += DENSITIES[name].log_anywhere(np.full(2, count), beyond, self._cap)
        density: Array = np.exp(logs)
        return density


def _deviation_left(readings: Array, amounts: Array, before: float) -> float:
    """Sum of the standard deviations of amounts, given readings in units of their noise.

    It is ``before`` where there are too few samples.
    """
    free = len(readings) - 1 - readings.shape[1]
    if free <= 0:
        return before
    centred, asked = readings - readings.mean(axis=0), amounts - amounts.mean(axis=0)
    products = centred.T @ asked
    known = centred.T @ centred + len(centred) * np.eye(centred.shape[1])
    left = (asked**2).sum(axis=0) - (products * np.linalg.solve(known, products)).sum(axis=0)
    return float(np.sqrt(np.maximum(left, 0.0) / free).sum())


@dataclass(frozen=True, kw_only=True)
class _Pairs:
    """Readings of p programs, d of each, beside what n samples predict.

    Attributes:
        read: Factors of the readings, shape (p, d, f).
        expected: Factors of the predictions, for robots that end as predicted and for those that
            end beside it, shape (p, f, n) each: inner products with ``read`` are log-densities.
        shares: Share of the readings that end in each of these ways.
        anywhere: Density of each reading in any pose times the share of outliers, shape (p, d, 1).
        elsewhere: Share of the outliers that may be anywhere.
        unknown: Which samples have no prediction, shape (p, n).
        tells: Which readings tell anything, shape (p, d). Outliers, and readings of samples without
            a prediction, do not: their density is the same for every body.
        alike: For each grouping, 1 where a sample is in the group of a reading's source, else 0,
            shape (d, n) each.
    """

    read: Array
    expected: Sequence[Array]
    shares: Sequence[float]
    anywhere: Array
    elsewhere: float
    unknown: Flags
    tells: Flags
    alike: Sequence[Array]

    def told(self, first: int, end: int) -> Array:
        """Information of the readings of programs ``first`` to ``end``, summed up, nats.

        Shape (programs, k).
        """
        information = np.zeros((end - first, len(self.alike)))
        draws, samples = self.alike[0].shape
        at_once = max(1, _PAIRS // samples)
        programs_at_once = max(1, at_once // draws)
        for start in range(first, end, programs_at_once):
            programs = slice(start, min(start + programs_at_once, end))
            for row in range(0, draws, at_once):
                rows = slice(row, row + at_once)
                information[start - first : programs.stop - first] += self._told_by(programs, rows)
        return information

    def _told_by(self, programs: slice, rows: slice) -> Array:
        anywhere = self.anywhere[programs, rows]
        densities = np.repeat(self.elsewhere * anywhere, self.unknown.shape[1], axis=2)
        for share, expected in zip(self.shares, self.expected, strict=True):
            logs = self.read[programs, rows] @ expected[programs]
            np.maximum(logs, _LEAST_LOG, out=logs)
            densities += share * np.exp(logs, out=logs)
        np.copyto(densities, anywhere, where=self.unknown[programs, None])
        of_all, sums = densities.mean(axis=2), []
        for alike in self.alike:
            of_group = np.einsum("pdn,dn->pd", densities, alike[rows]) / alike[rows].sum(axis=1)
            information = np.where(self.tells[programs, rows], np.log(of_group / of_all), 0.0)
            sums.append(information.sum(axis=1))
        return np.stack(sums, axis=1)
