"""The compiled part of information gains: every pair of samples in every program."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.morphology import Array
from estimator.physics.base import Flags
from estimator.physics.kernel.compiling import compiled, entrance, stamp

_SOURCES: Final = stamp(Path(__file__).parent)
_LEAST: Final = -700.0  # exponents below give 0


@compiled
def _inlier(
    touch: Flags,
    doubtful: Flags,
    tilt: Array,
    clearance: float,
    beyond: bool,
    sigma_tilt: float,
    sigma_clearance: float,
    wrong: float,
    cap: float,
    senses: Flags,
    bits: Flags,
    one: float,
    two: float,
    height: float,
    far: bool,
) -> float:
    """Density of a reading (bits, two tilts, height or beyond the range) under one prediction."""
    factor, exponent = 1.0, 0.0
    if senses[1]:
        x, y = (one - tilt[0]) / sigma_tilt, (two - tilt[1]) / sigma_tilt
        exponent -= 0.5 * (x * x + y * y)
        factor /= 2 * math.pi * sigma_tilt * sigma_tilt
    if senses[2]:
        if not far:
            x = (height - clearance) / sigma_clearance
            exponent -= 0.5 * x * x
            factor /= math.sqrt(2 * math.pi) * sigma_clearance
        elif not beyond:
            factor *= 0.5 * math.erfc((cap - clearance) / sigma_clearance / math.sqrt(2.0))
    if senses[0]:
        for bit in range(len(bits)):
            if doubtful[bit]:
                factor *= 0.5
            elif touch[bit] == bits[bit]:
                factor *= 1 - wrong
            else:
                factor *= wrong
    return factor * math.exp(exponent) if exponent > _LEAST else 0.0


def _make_gains(sources: int) -> Any:
    @entrance
    def gains(
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
        """Fills ``result``, in nats; see ``InformationGain.of``.

        An outlier, drawn or of a sample that foretells nothing, tells nothing: p0 is the same for
        every body.
        """
        programs, samples, sensors = touch.shape
        anywhere = outlier
        if senses[0]:
            anywhere *= 0.5**sensors
        if senses[1]:
            anywhere /= math.pi * math.pi
        if senses[2]:
            anywhere /= cap
        bits = np.empty(sensors, np.bool_)
        for program in range(programs):
            total = 0.0
            for draw in range(len(normals)):
                source = draw % samples
                if silent[program, source] or uniforms[draw, 0] < outlier:
                    continue
                one = tilt[program, source, 0] + sigma_tilt[source] * normals[draw, 0]
                two = tilt[program, source, 1] + sigma_tilt[source] * normals[draw, 1]
                height = clearance[program, source] + sigma_clearance[source] * normals[draw, 2]
                far = beyond[program, source] or height >= cap
                for bit in range(sensors):
                    chance = 0.5 if doubtful[program, source, bit] else wrong
                    bits[bit] = touch[program, source, bit] != (uniforms[draw, 1 + bit] < chance)
                everyone, own, members = 0.0, 0.0, 0
                for other in range(samples):
                    density = anywhere
                    if not silent[program, other]:
                        density += (1 - outlier) * _inlier(
                            touch[program, other],
                            doubtful[program, other],
                            tilt[program, other],
                            clearance[program, other],
                            beyond[program, other],
                            sigma_tilt[other],
                            sigma_clearance[other],
                            wrong,
                            cap,
                            senses,
                            bits,
                            one,
                            two,
                            height,
                            far,
                        )
                    everyone += density
                    if groups[other] == groups[source]:
                        own += density
                        members += 1
                total += math.log(own / members) - math.log(everyone / samples)
            result[program] = total / len(normals)
        return 0 * sources

    return gains


gains: Final = _make_gains(_SOURCES)
