"""Expected information gain of a motor program, by nested Monte Carlo.

A reading is drawn from each sample's prediction, noise included. Its information about the group of
samples that its sample belongs to is ``log p(y | group) - log p(y)``, under the likelihood by which
bodies are judged. So a program that separates bodies only by what cannot be measured, or in poses
that cannot be predicted, is worth nothing. With every sample a group of its own this is the
information about the whole body; with samples grouped by one leg's side, about that side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.executors import Threads
from estimator.physics.kernel.compiling import compiled, entrance, stamp
from estimator.posterior.model import mixture
from estimator.posterior.model.likelihood import apart
from estimator.posterior.model.mixture import level_of, log_densities
from estimator.posterior.model.noise import Noise, drawn
from estimator.posterior.model.sensor_data import DENSITIES
from estimator.readings.observation import PredictedReadings


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
        """Expected information of each program, in bits, shape (p, k).

        Args:
            readings: Of n equally likely samples in one program and the next, p · n rows.
            scales: Logarithms of their noise factors, shape (n, 2).
            groups: Group of each sample, by each of k groupings, shape (n, k).
            rng: Draws the noise, which is the same for all programs and groupings.
            draws: Readings per program; one sample after the other.
        """
        touch, tilt, clear = (name in self._modalities for name in ("touch", "tilt", "clearance"))
        predicted = readings.reshaped(len(readings) // len(scales), len(scales))
        bits = predicted.touch.shape[2]
        sensors = slice(None if touch else 0)
        noise_draws = drawn((draws, 3), rng)
        uniforms = rng.random((draws, 1 + bits))
        if not tilt:
            noise_draws[:, :2] = 0.0
        result = np.zeros((len(predicted.tilt), groups.shape[1]))
        laid_out = np.ascontiguousarray  # the kernel would be compiled for each layout
        arguments = (
            laid_out(predicted.touch[..., sensors]),
            laid_out(predicted.touch_doubtful[..., sensors]),
            laid_out(predicted.tilt) if tilt else np.zeros_like(predicted.tilt),
            laid_out(predicted.clearance),
            laid_out(predicted.saturated),
            predicted.undecided | ~predicted.valid,
            laid_out(scales),
            self._noise,
            self._anywhere(bits),
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

    def narrowed(self, readings: PredictedReadings, amounts: Array) -> Array:
        """Share by which each program is expected to narrow some amounts, shape (p,).

        By the sum of their standard deviations: that of the residuals of a linear regression on
        tilt and clearance, among samples with the same touch readings, over that before. Samples
        without a prediction narrow nothing.

        Args:
            readings: As for ``of``.
            amounts: Of the samples, shape (n, k), in one unit.
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
        for program, alike in enumerate(feet):
            for pattern in np.unique(alike):
                rows, each = np.flatnonzero(alike == pattern), before
                if pattern >= 0:
                    each = _left(measured[program, rows], amounts[rows], before)
                left[program] += len(rows) * each
        narrowed: Array = 1 - left / feet.shape[1] / before
        return narrowed

    def _anywhere(self, bits: int) -> Array:
        """Density of a reading anywhere times the share of outliers: within the range, beyond."""
        beyond = np.array([False, True])
        logs = np.full(2, math.log(self._noise.outlier))
        for name, count in (("touch", bits), ("tilt", 2), ("clearance", 1)):
            if name in self._modalities:
                logs += DENSITIES[name].log_anywhere(np.full(2, count), beyond, self._cap)
        density: Array = np.exp(logs)
        return density


def _left(readings: Array, amounts: Array, before: float) -> float:
    """Sum of the standard deviations of amounts, given readings in units of their noise.

    ``before`` where there are too few samples.
    """
    free = len(readings) - 1 - readings.shape[1]
    if free <= 0:
        return before
    centred, asked = readings - readings.mean(axis=0), amounts - amounts.mean(axis=0)
    both = centred.T @ asked
    known = centred.T @ centred + len(centred) * np.eye(centred.shape[1])
    left = (asked**2).sum(axis=0) - (both * np.linalg.solve(known, both)).sum(axis=0)
    return float(np.sqrt(np.maximum(left, 0.0) / free).sum())


_SOURCES: Final = stamp(Path(__file__).parent, *sorted(Path(mixture.__file__).parent.glob("*.py")))
_LEAST: Final = -60.0  # logarithm of a density that is negligible beside an outlier's


@compiled
def _differing(touch: Flags, doubtful: Flags, bits: Flags) -> tuple[float, float]:
    """Number of touch bits that differ from a prediction, and of those that are doubtful in it."""
    wrong, unsure = 0.0, 0.0
    for bit in range(len(bits)):
        if doubtful[bit]:
            unsure += 1.0
        elif touch[bit] != bits[bit]:
            wrong += 1.0
    return wrong, unsure


@compiled
def _draw_bits(touch: Flags, doubtful: Flags, wrong: float, uniforms: Array, bits: Flags) -> None:
    """Touch bits as they may be observed under one prediction; the first number is not theirs."""
    for bit in range(len(bits)):
        bits[bit] = touch[bit] != (uniforms[1 + bit] < (0.5 if doubtful[bit] else wrong))


@compiled
def _add_to_groups(density: float, one: Array, other: Array, of_groups: Array) -> None:
    """Adds a density to that of each group of which both samples are, which have one more."""
    for kind in range(len(one)):
        if one[kind] == other[kind]:
            of_groups[0, kind] += density
            of_groups[1, kind] += 1.0


def _make_gains(sources: int) -> Any:
    @entrance
    def gains(
        start: int,
        end: int,
        touch: Flags,
        doubtful: Flags,
        tilt: Array,
        clearance: Array,
        beyond: Flags,
        no_prediction: Flags,
        scales: Array,
        spread: Noise,
        anywhere: Array,
        cap: float,
        angles: float,
        clear: bool,
        groups: NDArray[np.int64],
        noise_draws: Array,
        uniforms: Array,
        result: Array,
    ) -> int:
        """Fills ``result`` of programs ``start`` to ``end``, in nats; see ``InformationGain.of``.

        Outliers and samples without a prediction give no information: their density is the same for
        every body.

        Args:
            scales: Logarithms of each sample's noise factors, shape (samples, 2).
            spread: Sensor noise.
            anywhere: Density of a reading anywhere, the share of outliers included, shape (2,):
                within the range of the distance sensor, and beyond it.
            angles: How many angles are read; where none, those of all samples are alike.
            clear: Whether clearance is read.
            noise_draws: Of two tilts and the clearance, in units of the noise, shape (draws, 3).
            uniforms: Decide on outliers and bits, shape (draws, 1 + sensors).
        """
        _, samples, sensors = touch.shape
        bits, of_groups = np.empty(sensors, np.bool_), np.zeros((2, groups.shape[1]))
        levels = [level_of(spread, 1.0, one[0], one[1]) for one in scales]
        beside = spread.outlier * spread.nearby
        for program in range(start, end):
            for draw in range(len(noise_draws)):
                source, chance = draw % samples, uniforms[draw, 0]
                if no_prediction[program, source] or beside <= chance < spread.outlier:
                    continue
                level = levels[source]
                of_tilt, of_clearance = level.tilt, level.clearance
                if chance < beside:
                    of_tilt, of_clearance = level.tilt_beside, level.clearance_beside
                one = tilt[program, source, 0] + of_tilt * noise_draws[draw, 0]
                two = tilt[program, source, 1] + of_tilt * noise_draws[draw, 1]
                height = clearance[program, source] + of_clearance * noise_draws[draw, 2]
                far = clear and (beyond[program, source] or height >= cap)
                if far:
                    height = cap
                _draw_bits(
                    touch[program, source],
                    doubtful[program, source],
                    spread.touch,
                    uniforms[draw],
                    bits,
                )
                elsewhere = anywhere[1 if far else 0]
                of_all = 0.0
                for other in range(samples):
                    density = elsewhere
                    if not no_prediction[program, other]:
                        away = height - clearance[program, other]
                        if far and beyond[program, other]:
                            away = -math.inf
                        near, nearby = log_densities(
                            (one - tilt[program, other, 0], two - tilt[program, other, 1]),
                            angles,
                            away,
                            clear,
                            far,
                            _differing(touch[program, other], doubtful[program, other], bits),
                            float(sensors),
                            levels[other],
                        )
                        density = (1 - spread.nearby) * elsewhere
                        if nearby > _LEAST:
                            density += beside * math.exp(nearby)
                        if near > _LEAST:
                            density += (1 - spread.outlier) * math.exp(near)
                    of_all += density
                    _add_to_groups(density, groups[other], groups[source], of_groups)
                for kind in range(groups.shape[1]):
                    told = math.log(of_groups[0, kind] / of_groups[1, kind] * samples / of_all)
                    result[program, kind] += told / len(noise_draws)
                    of_groups[0, kind] = of_groups[1, kind] = 0.0
        return 0 * sources

    return gains


gains: Final = _make_gains(_SOURCES)
