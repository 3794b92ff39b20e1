"""Stand-ins for drivers whose devices nobody emulates: they give what their contracts promise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

from robot.drivers.buses import Buses
from robot.drivers.sensors.contracts import BoardSettings
from robot.drivers.servos.servo_bus import ServoSettings
from robot.service.dry_run import NullServos
from sim_robot.simulator.electronics_sets import REACH_MM


class StandInServos:
    """Settings and driver of servos that do as they are told.

    Args:
        settings: Settings that these replace.
    """

    def __init__(self, settings: ServoSettings):
        self.name = f"stand-in for {settings.name}"
        self.outputs = settings.outputs
        self.counts = settings.counts
        self.known_counts = settings.known_counts
        self.per_update = settings.per_update
        self.reads_back = True
        self.driver = NullServos(dict.fromkeys(settings.outputs, 0))

    def open(self, buses: Buses) -> NullServos:
        """The same driver every time, its servos where they were left."""
        del buses
        return self.driver

    def __repr__(self) -> str:
        return self.name


class StandInBoard:
    """Settings and driver of a board with analogue inputs.

    Args:
        settings: Settings that these replace.
        volts: Returns the voltage of a channel, V.
    """

    def __init__(self, settings: BoardSettings, volts: Callable[[int], float]):
        self.name = f"stand-in for {settings.name}"
        self.dithers = settings.dithers
        self.inputs = settings.inputs
        self.rails = settings.rails
        self._volts = volts

    def open(self, buses: Buses) -> StandInBoard:
        """Returns this object, which is the driver, too."""
        del buses
        return self

    def probe(self) -> None:
        """Does nothing: the board is there."""

    def scan(self, low: int, high: int) -> list[float]:
        """Volts of the channels ``low`` to ``high``."""
        return [self._volts(channel) for channel in range(low, high + 1)]

    def close(self) -> None:
        """Does nothing."""

    def __repr__(self) -> str:
        return self.name


@dataclass(frozen=True)
class StandInSensor:
    """Settings and driver of a sensor that reads true, but for its noise."""

    name: str
    read: Callable[[], Any] = field(repr=False)
    channels: ClassVar[tuple[int, ...]] = ()
    reach: ClassVar[float] = REACH_MM / 1000

    def open(self, buses: Buses, called: str) -> StandInSensor:
        """Returns this object, which is the driver, too."""
        del buses, called
        return self

    def start(self) -> None:
        """Does nothing: the sensor is there."""

    check = close = start

    def acceleration(self) -> Any:
        """Reading of the sensor; of an accelerometer, the acceleration in g."""
        return self.read()

    load = distance = acceleration
