"""``Modality``: how one kind of reading is checked, compared, written down and said."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Final, Protocol, TypeAlias

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.errors import ReadingsError
from estimator.readings.observation import Observation, ObservedReadings
from protocol.wire.capabilities import Sensor

Value: TypeAlias = float | bool | None
"""One number of a reading; ``None`` where it was not taken."""

ROUNDING: Final = 1e-6
"""By how much a reading may exceed its range."""


class PredictedReadings(Protocol):
    """What n bodies feel; ``estimator.physics.base.Readings`` describes the arrays."""

    @property
    def touch(self) -> Flags:
        """Shape (n, s)."""

    @property
    def touch_doubtful(self) -> Flags:
        """Shape (n, s)."""

    @property
    def tilt(self) -> Array:
        """Shape (n, 2)."""

    @property
    def clearance(self) -> Array:
        """Shape (n,)."""

    @property
    def saturated(self) -> Flags:
        """Shape (n,)."""


class Modality(ABC):
    """One kind of sensor.

    Attributes:
        name: As in the capabilities, in observations and on the command line.
        unit: Of a value on the wire.
        on_parts: Whether each value belongs to a part, so that a problem says how many there are;
            else there are as many on every robot.
        upper: Largest value, where readings by hand leave it open; ``None`` where there is none.
        error_name: Name of the prediction error in ``validation.json``, with its unit.
        error_format: How a prediction error is said.
        heading: Of the prediction error in tables.
        table_factor: From ``error_name``'s unit to the heading's.
    """

    name: ClassVar[str]
    unit: ClassVar[str]
    on_parts: ClassVar[bool] = False
    upper: ClassVar[float | None] = None
    error_name: ClassVar[str]
    error_format: ClassVar[str]
    heading: ClassVar[str]
    table_factor: ClassVar[float] = 1.0

    # --- one reading ------------------------------------------------------------------------------

    @abstractmethod
    def values(self, observation: Observation) -> tuple[Value, ...]:
        """The numbers of a reading."""

    @abstractmethod
    def say(self, observation: Observation) -> str:
        """A reading as a person reads it, ``?`` for what is missing."""

    def wrong_sensor(self, sensor: Sensor) -> str | None:
        """What in a sensor's description cannot be, as the part of a sentence that says so."""
        return None

    @abstractmethod
    def wrong_reading(self, observation: Observation, sensor: Sensor | None) -> str | None:
        """What in a reading this sensor cannot have felt; ``None`` for a robot without it."""

    def shown(self, error: float | None) -> float | None:
        """A prediction error in the unit of ``heading``."""
        return None if error is None else self.table_factor * error

    def say_error(self, error: float | None) -> str:
        """A prediction error with its unit."""
        return "–" if error is None else self.error_format.format(error)

    # --- as columns of a table --------------------------------------------------------------------

    @abstractmethod
    def columns(self, count: int) -> tuple[str, ...]:
        """Headings of the columns that hold ``count`` values."""

    @abstractmethod
    def count(self, header: Sequence[str]) -> int:
        """How many values a table's rows tell, 0 where it has no column of this modality."""

    @abstractmethod
    def cell(self, value: Value) -> str:
        """A value as it is written."""

    @abstractmethod
    def parse(self, where: str, column: str, cell: str) -> Value:
        """A cell's value.

        Args:
            where: File and row, for the message.
            column: Its heading.
            cell: What stands there.

        Raises:
            ReadingsError: It is no such value.
        """

    @abstractmethod
    def field(self, values: Sequence[Value]) -> Mapping[str, object]:
        """The fields of an ``Observation`` that hold these values."""

    # --- models against the robot, and against each other -----------------------------------------

    @abstractmethod
    def predicted(self, readings: PredictedReadings) -> Array | Flags:
        """What n bodies feel, shape (n, values)."""

    @abstractmethod
    def error(self, readings: PredictedReadings, observed: ObservedReadings) -> Array:
        """The modality's term of the paper's subjective error, shape (n,).

        A missing reading adds nothing.

        Raises:
            EstimatorError: Robot and models have different numbers of sensors.
        """

    @abstractmethod
    def prediction_errors(self, predicted: Array, observed: ObservedReadings) -> Array:
        """Absolute errors in the unit of ``error_name``, shape (n, values); NaN where unknown.

        Args:
            predicted: Shape (n, values); NaN where a simulation cannot be believed.
            observed: What the robot felt.
        """

    @abstractmethod
    def differences(self, one: PredictedReadings, other: PredictedReadings) -> Array:
        """By how much the readings of two bodies differ in each of n programs.

        Returns:
            Shape (n, values), signed, in units of what the sensor can hardly tell apart.
        """

    def alike(self, one: PredictedReadings, other: PredictedReadings) -> Flags:
        """Whether the sensor can hardly tell two bodies apart, in each of n programs."""
        same: Flags = np.all(np.abs(self.differences(one, other)) <= 1, axis=1)
        return same


def parse_number(where: str, column: str, cell: str, least: float, largest: float) -> float | None:
    """A cell's number, or ``None`` where it is empty.

    Raises:
        ReadingsError: It is no number, or lies outside ``least`` to ``largest``.
    """
    text = cell.strip()
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        comma = ": write a point" if "," in text else ""
        raise ReadingsError(
            f"{where}: {column} must be a number or empty, not {text!r}{comma}."
        ) from None
    if not least <= value <= largest:  # also refuses NaN
        raise ReadingsError(f"{where}: {column} must lie in {least:g} to {largest:g}, not {text}.")
    return value
