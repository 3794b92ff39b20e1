"""Touch: which parts meet the ground."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.errors import EstimatorError, ReadingsError
from estimator.readings.modalities.base import Modality, PredictedReadings, Value
from estimator.readings.observation import Observation, ObservedReadings
from protocol.wire.capabilities import Sensor

COLUMN: Final = "touch_"


class Touch(Modality):
    """One bit for each part that carries a sensor."""

    name = "touch"
    unit = "bool"
    on_parts = True
    error_name = "touch"
    error_format = "{:.0%}"
    heading = "touch wrong (%)"
    table_factor = 100.0

    def values(self, observation: Observation) -> tuple[Value, ...]:
        """One bit per sensor."""
        return observation.touch

    def say(self, observation: Observation) -> str:
        """A digit per sensor: ``touch 0110``."""
        bits = "".join("?" if bit is None else str(int(bit)) for bit in observation.touch)
        return f"touch {bits or '?'}"

    def wrong_reading(self, observation: Observation, sensor: Sensor | None) -> str | None:
        """Bits that are not one to a sensor."""
        sensors = sensor.count if sensor else 0
        if len(observation.touch) != sensors:
            return f"{len(observation.touch)} touch bits of {sensors} touch sensors"
        return None

    def columns(self, count: int) -> tuple[str, ...]:
        """``touch_1`` to ``touch_n``."""
        return tuple(f"{COLUMN}{number}" for number in range(1, count + 1))

    def count(self, header: Sequence[str]) -> int:
        """One value per column."""
        return sum(column.startswith(COLUMN) for column in header)

    def cell(self, value: Value) -> str:
        """0, 1 or nothing."""
        return "" if value is None else str(int(value))

    def parse(self, where: str, column: str, cell: str) -> Value:
        """0, 1 or nothing."""
        text = cell.strip()
        if text not in ("", "0", "1"):
            raise ReadingsError(f"{where}: {column} must be 0, 1 or empty, not {text!r}.")
        return bool(int(text)) if text else None

    def field(self, values: Sequence[Value]) -> Mapping[str, object]:
        """``touch``."""
        return {"touch": tuple(values)}

    def predicted(self, readings: PredictedReadings) -> Array | Flags:
        """The bits."""
        return readings.touch

    def error(self, readings: PredictedReadings, observed: ObservedReadings) -> Array:
        """Bits that differ."""
        if readings.touch.shape[1] != len(observed.touch):
            raise EstimatorError(
                f"the robot has {len(observed.touch)} touch sensors but the problem describes "
                f"{readings.touch.shape[1]}: correct the problem file or leave touch out"
            )
        bits: Array = np.nansum(np.abs(observed.touch - readings.touch), axis=1)
        return bits

    def prediction_errors(self, predicted: Array, observed: ObservedReadings) -> Array:
        """1 for each bit that was foretold wrongly."""
        felt = observed.touch if observed.touch.size else math.nan
        return np.abs(predicted - felt)

    def differences(self, one: PredictedReadings, other: PredictedReadings) -> Array:
        """2 for each bit that differs and is doubtful in neither, 0 for the others."""
        doubtful = one.touch_doubtful | other.touch_doubtful
        different: Array = 2.0 * ((one.touch != other.touch) & ~doubtful)
        return different
