"""Clearance: from the middle of the belly to the ground, along the belly's normal."""

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

COLUMN: Final = "clearance_mm"
WEIGHT: Final = 10.0
"""Of a metre in the subjective error, beside a degree of tilt; the paper's."""

TOLERANCE: Final = 2e-3
"""Clearances that differ by no more are alike, m."""

RANGES: Final = (1e-3, 100.0)
"""Of distance sensors, m."""

_CONTACT: Final = 0.005  # m that a belly on the ground may read below it
_OFF: Final = 5.0  # times the noise, which is a root mean square


class Clearance(Modality):
    """One distance."""

    name = "clearance"
    unit = "m"
    upper = 0.2
    error_name = "clearance_mm"
    error_format = "{:.1f} mm"
    heading = "clearance (mm)"

    def values(self, observation: Observation) -> tuple[Value, ...]:
        """One distance, m."""
        return (observation.clearance,)

    def say(self, observation: Observation) -> str:
        """In millimetres: ``12 mm clear``."""
        height = observation.clearance
        return f"{'?' if height is None else f'{height * 1000:.0f} mm'} clear"

    def wrong_sensor(self, sensor: Sensor) -> str | None:
        """A range of micrometres or kilometres."""
        least, most = RANGES
        if sensor.upper is None or least <= sensor.upper <= most:
            return None
        return f"clearance reaches {sensor.upper:g} m, and must lie in {least:g} to {most:g} m"

    def wrong_reading(self, observation: Observation, sensor: Sensor | None) -> str | None:
        """A belly far below the ground, or beyond the range."""
        height = observation.clearance
        if height is None or sensor is None:
            return None
        below = max(_CONTACT, _OFF * sensor.noise)
        upper = math.inf if sensor.upper is None else sensor.upper + ROUNDING
        if -below <= height <= upper:
            return None
        return (
            f"a clearance of {height * 1000:.4g} mm, which must lie in "
            f"{-below * 1000:.4g} to {upper * 1000:.4g} mm"
        )

    def columns(self, count: int) -> tuple[str, ...]:
        """``clearance_mm``."""
        return (COLUMN,)

    def count(self, header: Sequence[str]) -> int:
        """One, where there is the column."""
        return int(COLUMN in header)

    def cell(self, value: Value) -> str:
        """Millimetres, or nothing."""
        return "" if value is None else f"{value * 1000:.4f}"

    def parse(self, where: str, column: str, cell: str) -> Value:
        """Millimetres, or nothing."""
        millimetres = parse_number(where, column, cell, -100.0, 10_000.0)
        return None if millimetres is None else millimetres / 1000

    def field(self, values: Sequence[Value]) -> Mapping[str, object]:
        """``clearance``."""
        (clearance,) = values
        return {"clearance": clearance}

    def predicted(self, readings: PredictedReadings) -> Array | Flags:
        """The distance, m."""
        return readings.clearance[:, None]

    def error(self, readings: PredictedReadings, observed: ObservedReadings) -> Array:
        """Ten times the absolute difference, m."""
        if math.isnan(observed.clearance):
            return np.zeros(len(readings.clearance))
        return WEIGHT * np.abs(observed.clearance - readings.clearance)

    def prediction_errors(self, predicted: Array, observed: ObservedReadings) -> Array:
        """In millimetres."""
        return 1000 * np.abs(predicted - observed.clearance)

    def differences(self, one: PredictedReadings, other: PredictedReadings) -> Array:
        """In units of ``TOLERANCE``."""
        return (one.clearance - other.clearance)[:, None] / TOLERANCE
