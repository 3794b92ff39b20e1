"""What servos and sensors of bodies make of a command and of a pose; see ``Bodies``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from estimator.body.arrays import DISTANCE_GAIN, LEVEL, TOO_HIGH, Bodies
from estimator.body.morphology import Array
from estimator.readings.observation import PredictedReadings


def performed(programs: Array, bodies: Bodies) -> Array:
    """Angles that motors reach in programs, by the travel of their servos, rad, shape (n, motors).

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


def as_sensed(readings: PredictedReadings, bodies: Bodies) -> PredictedReadings:
    """Readings as the bodies' sensors give them; limp parts lie on the ground and touch it.

    Args:
        readings: Of n bodies, as a back-end has them.
        bodies: These.
    """
    level, too_high = bodies.base[:, LEVEL], bodies.base[:, TOO_HIGH]
    gain = bodies.base[:, DISTANCE_GAIN]
    odd = np.flatnonzero(np.any(level != (1.0, 0.0, 0.0, 1.0), axis=1))
    if odd.size:
        tilt = readings.tilt.copy()
        felt = np.einsum("nij,nj->ni", level[odd].reshape(-1, 2, 2), np.sin(tilt[odd]))
        tilt[odd] = np.arcsin(np.clip(felt, -1.0, 1.0))
        readings = replace(readings, tilt=tilt)
    if np.any(gain != 1) or np.any(too_high != 0):
        height = np.maximum(gain * readings.clearance + too_high, 0.0)
        clearance = np.where(readings.saturated, readings.clearance, height)
        readings = replace(readings, clearance=clearance)
    always = np.where(bodies.limp, 1, bodies.stuck)
    rows, columns = np.nonzero((always != 0) & (bodies.sensor >= 0))
    if not rows.size:
        return readings
    known = np.zeros(readings.touch.shape, dtype=np.int64)
    known[rows, bodies.sensor[rows, columns]] = always[rows, columns]
    return replace(
        readings,
        touch=np.where(known == 0, readings.touch, known > 0),
        touch_doubtful=readings.touch_doubtful & (known == 0),
    )
