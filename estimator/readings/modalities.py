"""The modalities: how each kind of reading is checked, compared, written down and said.

A modality is an entry of ``MODALITIES``: a subclass of ``Modality`` that says what is its own.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar, Final, TypeAlias

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.errors import EstimatorError, ReadingsError
from estimator.readings.observation import Observation, PredictedReadings
from protocol.wire.capabilities import Sensor

Value: TypeAlias = float | bool | None
"""One number of a reading; ``None`` where it was not taken."""

ROUNDING: Final = 1e-6
"""By how much a reading may exceed its range, in its unit; no sensor resolves a millionth."""

CLEARANCE_RANGES: Final = (1e-3, 100.0)
"""Least and largest range of a distance sensor, m."""


class Modality(ABC):
    """One kind of sensor; its readings are the field ``name`` of observations and predictions.

    Attributes:
        name: Name in the capabilities, in observations, in predictions and on the command line.
        unit: Unit of a value on the wire.
        scalar: Whether a reading is a single number; else it is several.
        on_parts: Whether each value belongs to a part, so that a problem says how many there are;
            else there are as many on every robot.
        upper: Largest value, where readings by hand leave it open; ``None`` where there is none.
        weight: Weight of a unit in the paper's subjective error.
        error_factor: Factor from a value's unit to that of a prediction error.
        error_name: Name of the prediction error in ``validation.json``, with its unit.
        error_limit: Largest prediction error that noise explains, in the unit of ``error_name``;
            beyond it the body landed elsewhere, or is another.
        error_unit: What follows a prediction error that is said, in the unit of ``heading``.
        error_digits: How many of its digits after the point are said.
        heading: Heading of the prediction error in tables.
        table_factor: Factor from ``error_name``'s unit to the heading's.
    """

    name: ClassVar[str]
    unit: ClassVar[str]
    scalar: ClassVar[bool] = False
    on_parts: ClassVar[bool] = False
    upper: ClassVar[float | None] = None
    weight: ClassVar[float] = 1.0
    error_factor: ClassVar[float] = 1.0
    error_name: ClassVar[str]
    error_limit: ClassVar[float]
    error_unit: ClassVar[str]
    error_digits: ClassVar[int] = 1
    heading: ClassVar[str]
    table_factor: ClassVar[float] = 1.0

    # --- one reading ------------------------------------------------------------------------------

    def values(self, observation: Observation) -> tuple[Value, ...]:
        """The numbers of a reading."""
        reading = getattr(observation, self.name)
        return (reading,) if self.scalar else tuple(reading)

    def observed(self, observation: Observation) -> Array:
        """The numbers of a reading, NaN where one is missing, shape (values,)."""
        numbers = [math.nan if value is None else value for value in self.values(observation)]
        return np.array(numbers, dtype=float)

    def field(self, values: Sequence[Value]) -> Mapping[str, object]:
        """The field of an ``Observation`` that holds these values."""
        return {self.name: values[0] if self.scalar else tuple(values)}

    @abstractmethod
    def say(self, observation: Observation) -> str:
        """A reading as a person reads it, ``?`` for what is missing."""

    def wrong_sensor(self, sensor: Sensor) -> str | None:
        """What in a sensor's description cannot be, as the part of a sentence that says so."""
        return None

    @abstractmethod
    def wrong_reading(self, observation: Observation, sensor: Sensor | None) -> str | None:
        """What in a reading a robot's sensor, ``None`` if it has none, cannot have measured."""

    def shown(self, error: float | None) -> float | None:
        """A prediction error in the unit of ``heading``."""
        return None if error is None else self.table_factor * error

    def say_error(self, error: float | None) -> str:
        """A prediction error with its unit."""
        shown = self.shown(error)
        return "–" if shown is None else f"{shown:.{self.error_digits}f}{self.error_unit}"

    # --- as columns of a table --------------------------------------------------------------------

    @abstractmethod
    def columns(self, count: int) -> tuple[str, ...]:
        """Headings of the columns that hold ``count`` values."""

    @abstractmethod
    def count(self, header: Sequence[str]) -> int:
        """How many values a table's rows have, 0 where it has no column of this modality."""

    @abstractmethod
    def cell(self, value: Value) -> str:
        """A value as it is written; empty where it is missing."""

    @abstractmethod
    def parse(self, where: str, column: str, cell: str) -> Value:
        """A cell's value.

        Args:
            where: File and row, for the message.
            column: Heading of the column.
            cell: Content of the cell.

        Raises:
            ReadingsError: The cell holds no such value.
        """

    # --- predictions against the robot, and against each other ------------------------------------

    def predicted(self, readings: PredictedReadings) -> Array | Flags:
        """Predicted values of n bodies, shape (n, values)."""
        values: Array | Flags = getattr(readings, self.name)
        return values[:, None] if self.scalar else values

    def error(self, readings: PredictedReadings, observation: Observation) -> Array:
        """The modality's term of the paper's subjective error, shape (n,).

        The sum of absolute differences times ``weight``; a missing reading adds nothing.

        Raises:
            EstimatorError: Robot and models have different numbers of sensors.
        """
        observed, predicted = self.observed(observation), self.predicted(readings)
        if predicted.shape[1] != len(observed):
            raise EstimatorError(
                f"the robot has {len(observed)} {self.name} sensors but the problem describes "
                f"{predicted.shape[1]}: correct the problem file or leave {self.name} out"
            )
        terms = self.weight * np.abs(observed - predicted)
        error: Array = np.sum(np.where(np.isnan(observed), 0.0, terms), axis=1)
        return error

    def prediction_errors(self, predicted: Array, observation: Observation) -> Array:
        """Absolute errors in the unit of ``error_name``, shape (n, values); NaN where unknown.

        Nothing is known where robot and models have different numbers of sensors, which a modality
        that is left out may have.

        Args:
            predicted: Shape (n, values); NaN where a simulation cannot be believed.
            observation: What the robot measured.
        """
        observed = self.observed(observation)
        comparable = observed.size == predicted.shape[1]
        errors: Array = np.abs(predicted - (observed if comparable else math.nan))
        return self.error_factor * errors

    @abstractmethod
    def differences(self, one: PredictedReadings, other: PredictedReadings) -> Array:
        """By how much the readings of two bodies differ in each of n programs.

        Returns:
            Shape (n, values), signed, in units of what the sensor can hardly discriminate.
        """

    def alike(self, one: PredictedReadings, other: PredictedReadings) -> Flags:
        """Whether the sensor can hardly discriminate two bodies, in each of n programs."""
        same: Flags = np.all(np.abs(self.differences(one, other)) <= 1, axis=1)
        return same


class Touch(Modality):
    """One bit for each part that carries a sensor: whether it meets the ground."""

    name = "touch"
    unit = "bool"
    on_parts = True
    error_name = "touch"
    error_limit = 0.5
    error_unit = "%"
    error_digits = 0
    heading = "touch wrong (%)"
    table_factor = 100.0
    _COLUMN: ClassVar[str] = "touch_"

    def say(self, observation: Observation) -> str:
        """A digit per sensor: ``touch 0110``."""
        bits = "".join("?" if bit is None else str(int(bit)) for bit in observation.touch)
        return f"touch {bits or '?'}"

    def wrong_reading(self, observation: Observation, sensor: Sensor | None) -> str | None:
        """A number of bits that is not that of the sensors."""
        sensors = sensor.count if sensor else 0
        if len(observation.touch) != sensors:
            return f"{len(observation.touch)} touch bits of {sensors} touch sensors"
        return None

    def columns(self, count: int) -> tuple[str, ...]:
        """``touch_1`` to ``touch_n``."""
        return tuple(f"{self._COLUMN}{number}" for number in range(1, count + 1))

    def count(self, header: Sequence[str]) -> int:
        """One value per column."""
        return sum(column.startswith(self._COLUMN) for column in header)

    def cell(self, value: Value) -> str:
        """0, 1 or nothing."""
        return "" if value is None else str(int(value))

    def parse(self, where: str, column: str, cell: str) -> Value:
        """0, 1 or nothing."""
        text = cell.strip()
        if text not in ("", "0", "1"):
            raise ReadingsError(f"{where}: {column} must be 0, 1 or empty, not {text!r}.")
        return bool(int(text)) if text else None

    def differences(self, one: PredictedReadings, other: PredictedReadings) -> Array:
        """2 for each bit that differs and is doubtful in neither, 0 for the others."""
        doubtful = one.touch_doubtful | other.touch_doubtful
        different: Array = 2.0 * ((one.touch != other.touch) & ~doubtful)
        return different


class Quantity(Modality):
    """Numbers in columns of a fixed name.

    Attributes:
        column_names: Names of the columns, one for each value.
        written: Turns a value into the number that is written.
        read: Turns a written number into a value.
        written_range: Range that a written number must lie in.
        tolerance: Largest difference at which values can hardly be discriminated.
    """

    column_names: ClassVar[tuple[str, ...]]
    written: ClassVar[Callable[[float], float]]
    read: ClassVar[Callable[[float], float]]
    written_range: ClassVar[tuple[float, float]]
    tolerance: ClassVar[float]

    def columns(self, count: int) -> tuple[str, ...]:
        """``column_names``, however many values there are."""
        return self.column_names

    def count(self, header: Sequence[str]) -> int:
        """The number of all values where there is a column of any, else 0."""
        present = any(column in header for column in self.column_names)
        return len(self.column_names) if present else 0

    def cell(self, value: Value) -> str:
        """Four digits after the point, or nothing."""
        return "" if value is None else f"{type(self).written(value):.4f}"

    def parse(self, where: str, column: str, cell: str) -> Value:
        """A number, or nothing."""
        number = parse_number(where, column, cell, *self.written_range)
        return None if number is None else type(self).read(number)

    def say_limit(self) -> str:
        """``error_limit`` with its unit."""
        return f"{self.table_factor * self.error_limit:g}{self.error_unit}"

    def differences(self, one: PredictedReadings, other: PredictedReadings) -> Array:
        """Differences in units of ``tolerance``."""
        return (self.predicted(one) - self.predicted(other)) / self.tolerance


class Tilt(Quantity):
    """Two angles, left/right and forward/back: how far the main body is inclined."""

    name = "tilt"
    unit = "rad"
    weight = math.degrees(1.0)  # the paper's error counts degrees
    error_factor = math.degrees(1.0)
    error_name = "tilt_deg"
    error_limit = 1.5
    error_unit = "°"
    heading = "tilt (°)"
    column_names = ("tilt_lr_deg", "tilt_fb_deg")
    written = math.degrees
    read = math.radians
    written_range = (-90.0, 90.0)
    tolerance = math.radians(0.5)  # not tuned: above the default robot's noise of 0.3°

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


def _millimetres(metres: float) -> float:
    return metres * 1000


def _metres(millimetres: float) -> float:
    return millimetres / 1000


class Clearance(Quantity):
    """One distance: from the middle of the belly to the ground, along the belly's normal."""

    name = "clearance"
    unit = "m"
    scalar = True
    upper = 0.2
    weight = 10.0  # weight of a metre, where a degree of tilt has 1; the paper's
    error_factor = 1000.0
    error_name = "clearance_mm"
    error_limit = 5.0
    error_unit = " mm"
    heading = "clearance (mm)"
    column_names = ("clearance_mm",)
    written = _millimetres
    read = _metres
    written_range = (-100.0, 10_000.0)
    tolerance = 2e-3  # not tuned: twice the default robot's noise
    _TOO_LITTLE: ClassVar[float] = 0.02  # m below 0 that is believed; the wide offset is of 8 mm
    _OUTLIER: ClassVar[float] = 5.0  # times the noise, which is a root mean square; not tuned

    def say(self, observation: Observation) -> str:
        """In millimetres: ``12 mm clear``, or ``at least 200 mm clear`` where the sensor ends."""
        height = observation.clearance
        least = "at least " if observation.clearance_saturated else ""
        return f"{'?' if height is None else f'{least}{height * 1000:.0f} mm'} clear"

    def wrong_sensor(self, sensor: Sensor) -> str | None:
        """A range of micrometres or kilometres."""
        least, most = CLEARANCE_RANGES
        if sensor.upper is None or least <= sensor.upper <= most:
            return None
        return f"clearance reaches {sensor.upper:g} m, and must lie in {least:g} to {most:g} m"

    def wrong_reading(self, observation: Observation, sensor: Sensor | None) -> str | None:
        """A belly far below the ground, or beyond the range."""
        height = observation.clearance
        if height is None or sensor is None:
            return None
        slack = self._TOO_LITTLE + self._OUTLIER * sensor.noise
        upper = math.inf if sensor.upper is None else sensor.upper + ROUNDING
        if -slack <= height <= upper:
            return None
        return (
            f"a clearance of {height * 1000:.4g} mm, which must lie in "
            f"{-slack * 1000:.4g} to {upper * 1000:.4g} mm"
        )


MODALITIES: Final[Mapping[str, Modality]] = MappingProxyType(
    {modality.name: modality for modality in (Touch(), Tilt(), Clearance())}
)
"""The modalities by name. Errors are added up in this order, so it decides about last digits."""


def check_modalities(names: Sequence[str]) -> tuple[str, ...]:
    """The modalities in their usual order.

    Raises:
        EstimatorError: One is unknown, or there is none.
    """
    unknown = sorted(set(names) - set(MODALITIES))
    if unknown or not names:
        raise EstimatorError(
            f"modalities must be one or more of {', '.join(MODALITIES)}, "
            f"not {', '.join(unknown) or 'none'}"
        )
    return tuple(name for name in MODALITIES if name in names)


def parse_number(where: str, column: str, cell: str, least: float, largest: float) -> float | None:
    """A cell's number, or ``None`` where it is empty.

    Raises:
        ReadingsError: The cell is no number, or lies outside ``least`` to ``largest``.
    """
    text = cell.strip()
    if not text:
        return None
    try:
        number = float(text)
    except ValueError:
        comma = ": write a point" if "," in text else ""
        raise ReadingsError(
            f"{where}: {column} must be a number or empty, not {text!r}{comma}."
        ) from None
    if not least <= number <= largest:  # also refuses NaN
        raise ReadingsError(f"{where}: {column} must lie in {least:g} to {largest:g}, not {text}.")
    return number
