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

_SOURCES: Final = stamp(Path(__file__).parent)
_LEAST: Final = -60.0  # densities with smaller exponents vanish beside an outlier's


@compiled
def _draw_bits(touch: Flags, doubtful: Flags, wrong: float, uniforms: Array, bits: Flags) -> None:
    """Touch bits as they may be felt under one prediction; the first number is not theirs."""
    for bit in range(len(bits)):
        bits[bit] = touch[bit] != (uniforms[1 + bit] < (0.5 if doubtful[bit] else wrong))


@compiled
def _bits_factor(touch: Flags, doubtful: Flags, bits: Flags, wrong: float) -> float:
    """Probability of touch bits under one prediction."""
    factor = 1.0
    for bit in range(len(bits)):
        if doubtful[bit]:
            factor *= 0.5
        elif touch[bit] == bits[bit]:
            factor *= 1 - wrong
        else:
            factor *= wrong
    return factor


@compiled
def _clearance_factor(far: bool, clearance: float, beyond: bool, cap: float, sigma: float) -> float:
    """What stands before the exponential of a clearance's density under one prediction.

    Where the ground is beyond the sensor's range, the probability that it is.
    """
    if not far:
        return 1 / (math.sqrt(2 * math.pi) * sigma)
    return 1.0 if beyond else 0.5 * math.erfc((cap - clearance) / sigma / math.sqrt(2.0))


@compiled
def _take_reciprocals(sigma: Array, counts: bool, result: Array) -> None:
    """1 / sigma, or 0 for what does not count."""
    for sample in range(len(sigma)):
        result[sample] = 1 / sigma[sample] if counts else 0.0


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
        silent: Flags,
        sigma_tilt: Array,
        sigma_clearance: Array,
        wrong: float,
        outlier: float,
        cap: float,
        senses: Flags,
        groups: NDArray[np.int64],
        normals: Array,
        uniforms: Array,
        result: Array,
    ) -> int:
        """Fills ``result`` of programs ``start`` to ``end``, in nats; see ``InformationGain.of``.

        An outlier, drawn or of a sample that foretells nothing, tells nothing: p0 is the same for
        every body.
        """
        _, samples, sensors = touch.shape
        anywhere = outlier
        if senses[0]:
            anywhere *= 0.5**sensors
        if senses[1]:
            anywhere /= math.pi * math.pi
        if senses[2]:
            anywhere /= cap
        bits = np.empty(sensors, np.bool_)
        flat, upright = np.empty(samples), np.empty(samples)
        _take_reciprocals(sigma_tilt, senses[1], flat)
        _take_reciprocals(sigma_clearance, senses[2], upright)
        for program in range(start, end):
            total = 0.0
            for draw in range(len(normals)):
                source = draw % samples
                if silent[program, source] or uniforms[draw, 0] < outlier:
                    continue
                one = tilt[program, source, 0] + sigma_tilt[source] * normals[draw, 0]
                two = tilt[program, source, 1] + sigma_tilt[source] * normals[draw, 1]
                height = clearance[program, source] + sigma_clearance[source] * normals[draw, 2]
                far = beyond[program, source] or height >= cap
                _draw_bits(
                    touch[program, source], doubtful[program, source], wrong, uniforms[draw], bits
                )
                everyone, own, members = 0.0, 0.0, 0
                for other in range(samples):
                    density = anywhere
                    x = (one - tilt[program, other, 0]) * flat[other]
                    y = (two - tilt[program, other, 1]) * flat[other]
                    z = 0.0 if far else (height - clearance[program, other]) * upright[other]
                    exponent = -0.5 * (x * x + y * y + z * z)
                    if exponent > _LEAST and not silent[program, other]:
                        inlier = (1 - outlier) * math.exp(exponent)
                        if senses[1]:
                            inlier *= flat[other] * flat[other] / (2 * math.pi)
                        if senses[2]:
                            inlier *= _clearance_factor(
                                far,
                                clearance[program, other],
                                beyond[program, other],
                                cap,
                                sigma_clearance[other],
                            )
                        if senses[0]:
                            inlier *= _bits_factor(
                                touch[program, other], doubtful[program, other], bits, wrong
                            )
                        density += inlier
                    everyone += density
                    if groups[other] == groups[source]:
                        own += density
                        members += 1
                total += math.log(own / members) - math.log(everyone / samples)
            result[program] = total / len(normals)
        return 0 * sources

    return gains


gains: Final = _make_gains(_SOURCES)
