"""What servos and sensors of bodies make of a command and of a pose; see ``Bodies``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from estimator.body.arrays import LEVEL, ROUND, Bodies
from estimator.body.morphology import Array
from estimator.readings.observation import PredictedReadings


def performed(programs: Array, bodies: Bodies) -> Array:
    """Angles that motors reach in programs, rad, shape (n, motors); see ``travel`` and ``short``.

    For a simulator that takes bodies as objects, which have neither.

    Args:
        programs: Motor programs, rad, shape (n, motors).
        bodies: The body that performs each program.
    """
    is_odd = (bodies.travel != 1) | (bodies.short != 0)
    row, part = np.nonzero(is_odd & (bodies.motor >= 0))
    if not row.size:
        return programs
    angles, motor = programs.copy(), bodies.motor[row, part]
    told = angles[row, motor] * bodies.travel[row, part]
    short = np.clip(bodies.short[row, part], -np.abs(told), np.abs(told))
    angles[row, motor] = told - short * np.sign(told)
    return angles


def as_sensed(readings: PredictedReadings, bodies: Bodies) -> PredictedReadings:
    """Readings as the bodies' sensors give them; limp parts lie on the ground and touch it.

    Args:
        readings: Readings of n bodies, as a back-end predicts them.
        bodies: The n bodies.
    """
    odd_tilt, odd_distance, odd_touch = bodies.odd_sensors
    if not (odd_tilt or odd_distance or odd_touch):
        return readings
    tilt, clearance = readings.tilt, readings.clearance
    source, rows = bodies.origin
    # Columns become contiguous in memory.
    errors = source.base[:, LEVEL.start : ROUND].T.take(rows, axis=1)
    if odd_tilt:
        a, b, c, d, *_ = errors
        odd = (a != 1) | (b != 0) | (c != 0) | (d != 1)
        measured = np.empty_like(tilt)
        left, forward = np.sin(tilt).T
        measured[:, 0] = a * left + b * forward
        measured[:, 1] = c * left + d * forward
        measured = np.arcsin(np.maximum(np.minimum(measured, 1.0), -1.0))
        tilt = np.where(odd[:, None], measured, tilt)
    if odd_distance:
        *_, too_high, gain = errors
        height = gain * clearance + too_high  # below 0 where a belly on the ground reads too little
        clearance = np.where(readings.saturated, clearance, height)
    touch, doubtful = readings.touch, readings.touch_doubtful
    if odd_touch:
        stuck = np.where(bodies.limp, 1, bodies.stuck)
        rows, columns = np.nonzero((stuck != 0) & (bodies.sensor >= 0))
        fixed = np.zeros(touch.shape, dtype=np.int64)
        fixed[rows, bodies.sensor[rows, columns]] = stuck[rows, columns]
        touch, doubtful = np.where(fixed == 0, touch, fixed > 0), doubtful & (fixed == 0)
    return replace(readings, tilt=tilt, clearance=clearance, touch=touch, touch_doubtful=doubtful)
