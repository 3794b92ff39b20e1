"""Sensor drivers: an accelerometer gives g, a touch sensor newtons or one bit, a distance metres.

What is peculiar to a technique (volts, rails, registers) stays within its driver.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar, Final, Protocol

from robot.drivers.buses import Buses, DriverSettings
from robot.drivers.guard import open_driver
from robot.drivers.links.analogue_inputs import AnalogueBoard, AnalogueInputs
from robot.toml_sections import Section
from robot.uncertainty import Uncertainty


class SensorDriver(Protocol):
    """A sensor; call ``start`` first.

    It may have ``details()``, which returns what the doctor tells beside the readings, and
    ``link``, its ``I2CLink``, whose repeated transfers the doctor counts. A sample raises
    ``DeviceError`` where the device failed.

    Attributes:
        name: Name of the device, as ``SensorSettings.name``.
    """

    name: str

    def start(self) -> None:
        """Opens the link, anew after a fault; finds and identifies the device, and sets it up.

        Behind the configured name there may be another adapter than before, and in the device what
        another program left: all settings are written, or read back.

        Raises:
            DeviceError: The link cannot be opened, or the device is not what it should be.
        """

    def check(self) -> None:
        """Checks that the latest readings of the resting robot can be believed.

        Raises:
            DeviceDataError: They cannot: the device answers, and is stuck or disconnected.
        """

    def close(self) -> None:
        """Closes the link, if it is open; ``start`` may follow."""


class Accelerometer(SensorDriver, Protocol):
    """An accelerometer with three axes: x forward, y left, z up."""

    def acceleration(self) -> tuple[float, float, float]:
        """One sample, g; at rest it is (0, 0, 1) on level ground."""
        ...


class TouchSensor(SensorDriver, Protocol):
    """A sensor of contact between one part and the ground."""

    def load(self) -> float | bool:
        """One sample: the load on the part, N; or, of a switch, whether it is pressed."""
        ...


class DistanceSensor(SensorDriver, Protocol):
    """A sensor of the distance below the belly."""

    def distance(self) -> float | None:
        """One sample: distance to what is in front of the sensor, m; ``None`` beyond its reach."""
        ...


class SensorSettings(DriverSettings, Protocol):
    """The settings of one kind of sensor driver."""

    @property
    def channels(self) -> tuple[int, ...]:
        """Inputs of the ``[daq]`` board that the sensor occupies; none if it is on another bus."""

    def open(self, buses: Buses, called: str) -> Any:
        """The driver of an accelerometer, a touch or a distance sensor, by its table.

        Args:
            buses: Buses of the computer; with analogue inputs where ``channels`` names any.
            called: Name of the sensor in ``robot.toml``: a touch sensor's own, or the table's.
        """


class DistanceSettings(SensorSettings, Protocol):
    """The settings of a distance sensor.

    Attributes:
        reach: Largest distance that the sensor can give, m.
    """

    reach: ClassVar[float]


LAST_INPUT: Final = 1023
"""Largest number of an input in a file; which of these there are, a board's settings say."""


class BoardSettings(DriverSettings, Protocol):
    """The settings of one kind of acquisition board, the ``[daq]`` table.

    Attributes:
        dithers: Whether a live input hardly ever gives the same code twice running.
    """

    dithers: ClassVar[bool]

    @property
    def inputs(self) -> range:
        """Numbers of the inputs, consecutive; a board that is asked for them may have fewer."""

    @property
    def rails(self) -> tuple[float, float]:
        """The volts at the ends of the input range."""

    def open(self, buses: Buses) -> AnalogueBoard:
        """The board's driver, whose ``probe`` opens the link."""


def attach_board(buses: Buses, settings: BoardSettings) -> Buses:
    """Opens and probes a board; returns the buses with its inputs.

    Raises:
        DeviceError: The board cannot be opened, or is not what it should be.
    """
    board: AnalogueBoard = open_driver(settings, buses)
    try:
        board.probe()
    except BaseException:
        board.close()
        raise
    inputs = AnalogueInputs(
        board,
        name=settings.name,
        rails=settings.rails,
        dithers=settings.dithers,
        clock=buses.clock,
    )
    return replace(buses, analogue=inputs)


AXIS_KEYS: Final = MappingProxyType({"V": ("zero_v", "volts_per_g"), "g": ("zero_g", "g_per_g")})
"""Keys of an axis's reading at 0 g, and of its increase from there to 1 g, by unit."""

MOUNTING_KEYS: Final = ("forward", "left", "up")
"""Keys that say which of a chip's axes points forward, left and up."""

# Limits by unit, beyond which somebody erred: of an axis's reading at 0 g (±), and of its increase
# from there to 1 g (least, most).
_ZEROS: Final = MappingProxyType({"V": 10.0, "g": 0.5})
_GAINS: Final = MappingProxyType({"V": (0.02, 5.0), "g": (0.5, 2.0)})


@dataclass(frozen=True, kw_only=True)
class CalibratedAxes(ABC):
    """Settings of an accelerometer that ``robotd calibrate`` can calibrate; its driver has ``raw``.

    Attributes:
        unit: Unit of what ``raw`` gives: ``V`` or ``g``.
        zero: Reading at 0 g along x (forward), y (left), z (up).
        per_g: Increase of the reading from 0 to 1 g; negative where an axis points the other way.
        uncertainty: Uncertainty of what is level for the main body, and of the measured gravity.
    """

    unit: ClassVar[str]
    zero: tuple[float, ...]
    per_g: tuple[float, ...]
    uncertainty: Uncertainty = Uncertainty()

    def acceleration(self, raw: Sequence[float]) -> tuple[float, float, float]:
        """Acceleration along x, y, z in g."""
        triples = zip(raw, self.zero, self.per_g, strict=True)
        x, y, z = ((value - zero) / gain for value, zero, gain in triples)
        return x, y, z

    @abstractmethod
    def axis(self, index: int) -> str:
        """Source of the axis x, y or z, by its index, for a sentence."""

    @property
    def wiring(self) -> Mapping[str, str | tuple[int, ...]]:
        """What ``robot.toml`` has of ``channels``, ``forward``, ``left``, ``up``.

        A calibration holds for these values only.
        """
        return {}

    @property
    @abstractmethod
    def key(self) -> str:
        """Key of ``robot.toml`` that says where each axis comes from."""


def read_axes(table: Section, unit: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Reads the axes' readings at 0 g, and their increases per g, in ``unit``."""
    zero, gain = AXIS_KEYS[unit]
    gains = table.magnitudes(gain, 3, *_GAINS[unit])
    return table.numbers(zero, 3, -_ZEROS[unit], _ZEROS[unit]), gains
