"""The compiled part of information gains: every pair of samples in every program."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.physics.kernel.compiling import compiled, entrance, stamp
from estimator.posterior.model import mixture, noise
from estimator.posterior.model.mixture import Level, Spread, level_of, log_densities

_SOURCES: Final = stamp(Path(__file__).parent, *map(Path, (mixture.__file__, noise.__file__)))
_LEVEL_SIZE: Final = len(Level._fields)
_LEAST: Final = -60.0  # logarithm of a density that vanishes beside an outlier's


@compiled
def _differing(touch: Flags, doubtful: Flags, bits: Flags) -> tuple[float, float]:
    """How many touch bits are not as one prediction has them, and of how many it is not sure."""
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
def _keep(level: Level, kept: Array) -> None:
    for number in range(len(level)):
        kept[number] = level[number]


@compiled
def _kept(levels: Array, row: int) -> Level:
    return Level(
        levels[row, 0],
        levels[row, 1],
        levels[row, 2],
        levels[row, 3],
        levels[row, 4],
        levels[row, 5],
        levels[row, 6],
        levels[row, 7],
        levels[row, 8],
        levels[row, 9],
    )


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
        spread: Spread,
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

        What a robot feels anywhere, or that a sample has no prediction, tells nothing: that density
        is the same for every body.

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
        bits = np.empty(sensors, np.bool_)
        levels = np.empty((samples, _LEVEL_SIZE))
        for sample in range(samples):
            _keep(level_of(spread, 1.0, scales[sample, 0], scales[sample, 1]), levels[sample])
        beside = spread.outlier * spread.nearby
        for program in range(start, end):
            total = 0.0
            for draw in range(len(noise_draws)):
                source, chance = draw % samples, uniforms[draw, 0]
                if no_prediction[program, source] or beside <= chance < spread.outlier:
                    continue
                level = _kept(levels, source)
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
                everyone, own, members = 0.0, 0.0, 0
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
                            _kept(levels, other),
                        )
                        density = (1 - spread.nearby) * elsewhere
                        if nearby > _LEAST:
                            density += beside * math.exp(nearby)
                        if near > _LEAST:
                            density += (1 - spread.outlier) * math.exp(near)
                    everyone += density
                    if groups[other] == groups[source]:
                        own += density
                        members += 1
                total += math.log(own / members) - math.log(everyone / samples)
            result[program] = total / len(noise_draws)
        return 0 * sources

    return gains


gains: Final = _make_gains(_SOURCES)
