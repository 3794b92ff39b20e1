"""What servos make of programs, and sensors of poses, on a robot that deviates from its problem.

Of most bodies they do what they should, and nothing is changed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from estimator.body.arrays import TILT_GAIN, TOO_HIGH, Bodies
from estimator.body.morphology import Array
from estimator.physics.base import Readings


def performed(programs: Array, bodies: Bodies) -> Array:
    """How far motors turn that are told to perform programs, rad, shape (n, motors).

    Args:
        programs: rad, shape (n, motors).
        bodies: The body of each.
    """
    odd, part = np.nonzero((bodies.travel != 1) & (bodies.motor >= 0))
    if not odd.size:
        return programs
    angles = programs.copy()
    angles[odd, bodies.motor[odd, part]] *= bodies.travel[odd, part]
    return angles


def as_sensed(readings: Readings, bodies: Bodies) -> Readings:
    """What the bodies' sensors make of poses: limp parts lie on the ground, and are observed there.

    Args:
        readings: Of n bodies, as a back-end has them.
        bodies: These.
    """
    gain, too_high = bodies.base[:, TILT_GAIN], bodies.base[:, TOO_HIGH]
    if np.any(gain != 1) or np.any(too_high != 0):
        height = np.maximum(readings.clearance + too_high, 0.0)
        readings = replace(
            readings,
            tilt=readings.tilt * gain[:, None],
            clearance=np.where(readings.saturated, readings.clearance, height),
        )
    rows, columns = np.nonzero(bodies.limp & (bodies.sensor >= 0))
    if not rows.size:
        return readings
    lying = np.zeros(readings.touch.shape, dtype=bool)
    lying[rows, bodies.sensor[rows, columns]] = True
    return replace(
        readings,
        touch=readings.touch | lying,
        touch_doubtful=readings.touch_doubtful & ~lying,
    )
