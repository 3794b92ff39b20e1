"""Tilt: how far the main body leans, left/right and forward/back."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.readings.modalities.base import (
    ROUNDING,
    Modality,
    PredictedReadings,
    Value,
    parse_number,
)
from estimator.readings.observation import Observation, ObservedReadings
from protocol.wire.capabilities import Sensor

COLUMNS: Final = ("tilt_lr_deg", "tilt_fb_deg")
TOLERANCE: Final = math.radians(0.5)
"""Tilts that differ by no more are alike, rad."""


class Tilt(Modality):
    """Two angles."""

    name = "tilt"
    unit = "rad"
    error_name = "tilt_deg"
    error_format = "{:.1f}°"
    heading = "tilt (°)"

    def values(self, observation: Observation) -> tuple[Value, ...]:
        """Left/right and forward/back, rad."""
        return observation.tilt

    def say(self, observation: Observation) -> str:
        """In degrees: ``tilt -4.7°, 0.2°``."""
        angles = (
            "?" if angle is None else f"{math.degrees(angle):.1f}°" for angle in observation.tilt
        )
        return f"tilt {', '.join(angles)}"

    def wrong_reading(self, observation: Observation, sensor: Sensor | None) -> str | None:
        """A tilt beyond a right angle."""
        for tilt in observation.tilt:
            if tilt is not None and abs(tilt) > math.pi / 2 + ROUNDING:
                return f"a tilt of {math.degrees(tilt):.4g}°, which must lie in -90° to 90°"
        return None

    def columns(self, count: int) -> tuple[str, ...]:
        """Left/right and forward/back."""
        return COLUMNS

    def count(self, header: Sequence[str]) -> int:
        """Both, where there is a column of either."""
        return len(COLUMNS) if any(column in header for column in COLUMNS) else 0

    def cell(self, value: Value) -> str:
        """Degrees, or nothing."""
        return "" if value is None else f"{math.degrees(value):.4f}"

    def parse(self, where: str, column: str, cell: str) -> Value:
        """Degrees, or nothing."""
        angle = parse_number(where, column, cell, -90.0, 90.0)
        return None if angle is None else math.radians(angle)

    def field(self, values: Sequence[Value]) -> Mapping[str, object]:
        """``tilt``."""
        return {"tilt": tuple(values)}

    def predicted(self, readings: PredictedReadings) -> Array | Flags:
        """Both tilts, rad."""
        return readings.tilt

    def error(self, readings: PredictedReadings, observed: ObservedReadings) -> Array:
        """Sum of the absolute differences, degrees."""
        degrees: Array = np.nansum(np.degrees(np.abs(observed.tilt - readings.tilt)), axis=1)
        return degrees

    def prediction_errors(self, predicted: Array, observed: ObservedReadings) -> Array:
        """In degrees."""
        return np.degrees(np.abs(predicted - observed.tilt))

    def differences(self, one: PredictedReadings, other: PredictedReadings) -> Array:
        """In units of ``TOLERANCE``."""
        return (one.tilt - other.tilt) / TOLERANCE
