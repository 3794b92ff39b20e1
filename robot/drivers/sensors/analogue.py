"""Sensors on the analogue inputs of the ``[daq]`` board, with their calibration in volts.

An accelerometer gives a voltage for each axis, a strain gauge one for its load. A switch gives two:
a resistor to the supply, or to ground, makes one voltage while it is open and another while it is
closed. With a second resistor across the switch, neither voltage is that of a wire that has come
off, which is then noticed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

from robot.drivers.buses import Buses
from robot.drivers.links.analogue_inputs import AnalogueInputs
from robot.drivers.sensors.contracts import LAST_INPUT, CalibratedAxes, read_axes
from robot.errors import DeviceDataError
from robot.toml_sections import Section


class OnInputs:
    """Base class of a sensor on some inputs of a board, which is opened and closed elsewhere."""

    def __init__(self, inputs: AnalogueInputs, channels: tuple[int, ...]):
        self._inputs = inputs
        self._channels = channels

    def start(self) -> None:
        """Does nothing: the board was found."""

    def check(self) -> None:
        """Looks for inputs that are stuck or at an end of the range."""
        self._inputs.check(self._channels)

    def close(self) -> None:
        """Does nothing: the board is closed elsewhere."""


@dataclass(frozen=True, kw_only=True)
class AnalogueAxes(CalibratedAxes):
    """An accelerometer's three axes, x forward, y left, z up: volts at 0 g and volts per g."""

    name: ClassVar[str] = "analogue"
    unit: ClassVar[str] = "V"
    channels: tuple[int, ...]

    @classmethod
    def read(cls, table: Section) -> AnalogueAxes:
        """Reads the keys ``channels``, ``zero_v`` and ``volts_per_g``."""
        channels = table.numbers("channels", 3, 0, LAST_INPUT)
        if any(channel != int(channel) for channel in channels) or len(set(channels)) < 3:
            given = ", ".join(f"{channel:g}" for channel in channels)
            raise table.refuse("channels", f"must be three different integers, not {given}.")
        zero, gains = read_axes(table, cls.unit)
        return cls(channels=tuple(int(one) for one in channels), zero=zero, per_g=gains)

    def open(self, buses: Buses, called: str) -> AnalogueAccelerometer:
        """Connects the axes to the board's inputs."""
        assert buses.analogue is not None
        names = (f"the {called}'s {axis} axis" for axis in "xyz")
        buses.analogue.connect(dict(zip(self.channels, names, strict=True)))
        return AnalogueAccelerometer(self, buses.analogue)

    def axis(self, index: int) -> str:
        """Name of the input of an axis, for a sentence."""
        return f"channel {self.channels[index]}"

    @property
    def wiring(self) -> Mapping[str, tuple[int, ...]]:
        """The inputs."""
        return {"channels": self.channels}

    @property
    def key(self) -> str:
        """Key of ``robot.toml`` that names the inputs."""
        return "accelerometer.channels"

    def __str__(self) -> str:
        return f"analogue inputs {', '.join(map(str, self.channels))}"


class AnalogueAccelerometer(OnInputs):
    """An accelerometer on three analogue inputs."""

    name = AnalogueAxes.name

    def __init__(self, axes: AnalogueAxes, inputs: AnalogueInputs):
        super().__init__(inputs, axes.channels)
        self._axes = axes

    def raw(self) -> tuple[float, float, float]:
        """Voltages of the axes x, y and z in a new scan, V."""
        volts = self._inputs.scan()
        x, y, z = (volts[channel] for channel in self._axes.channels)
        return x, y, z

    def acceleration(self) -> tuple[float, float, float]:
        """Acceleration along x, y and z in a new scan, g."""
        return self._axes.acceleration(self.raw())


@dataclass(frozen=True, kw_only=True)
class OnOneInput:
    """Base class of the settings of a sensor on one analogue input, ``channel``."""

    channel: int

    @property
    def channels(self) -> tuple[int, ...]:
        """The one input of the sensor."""
        return (self.channel,)

    def __str__(self) -> str:
        return f"analogue input {self.channel}"


@dataclass(frozen=True, kw_only=True)
class StrainGauge(OnOneInput):
    """Settings of an amplified strain gauge.

    Attributes:
        tare: Volts while the foot is free.
        volts_per_newton: Sensitivity; its sign is the direction of mounting.
    """

    name: ClassVar[str] = "analogue"
    tare: float
    volts_per_newton: float

    @classmethod
    def read(cls, table: Section) -> StrainGauge:
        """Reads the keys ``channel``, ``tare_v`` and ``volts_per_newton``."""
        tare, gain = read_bridge(table)
        return cls(
            channel=table.integer("channel", 0, LAST_INPUT), tare=tare, volts_per_newton=gain
        )

    def open(self, buses: Buses, called: str) -> AnalogueGauge:
        """Connects the gauge to the board's input."""
        assert buses.analogue is not None
        buses.analogue.connect({self.channel: f"the gauge of {called}"})
        return AnalogueGauge(self, buses.analogue)

    def force(self, volts: float) -> float:
        """Load on the foot that a voltage stands for, N."""
        return (volts - self.tare) / self.volts_per_newton


class AnalogueGauge(OnInputs):
    """A strain gauge on one analogue input."""

    name = StrainGauge.name

    def __init__(self, gauge: StrainGauge, inputs: AnalogueInputs):
        super().__init__(inputs, gauge.channels)
        self._gauge = gauge

    def load(self) -> float:
        """The load, N, at the moment at which the other analogue sensors were read."""
        return self._gauge.force(self._inputs.same_moment()[self._gauge.channel])


def read_bridge(table: Section) -> tuple[float, float]:
    """Reads the keys ``tare_v`` and ``volts_per_newton``."""
    gain = table.magnitude("volts_per_newton", 1e-4, 50)
    return table.number("tare_v", -10, 10), gain


LEAST_CHANGE: Final = 0.3
"""Least difference of free and pressed, V: well above the noise of any input."""

# Shares of the way from the free to the pressed voltage.
_ON: Final = 0.6
_OFF: Final = 0.4
_OVERSHOOT: Final = 0.3  # before free or after pressed: a wire has come off


@dataclass(frozen=True, kw_only=True)
class SwitchSettings(OnOneInput):
    """Input of a switch, and its volts with the foot pressed and free."""

    name: ClassVar[str] = "switch"
    pressed: float
    free: float

    @classmethod
    def read(cls, table: Section) -> SwitchSettings:
        """Reads the keys ``channel``, ``pressed_v`` and ``free_v``."""
        pressed, free = table.number("pressed_v", -10, 10), table.number("free_v", -10, 10)
        if abs(pressed - free) < LEAST_CHANGE:
            raise table.refuse(
                "pressed_v",
                f"must differ from free_v, {free:g}, by {LEAST_CHANGE:g} volts at least, "
                f"not be {pressed:g}.",
            )
        return cls(channel=table.integer("channel", 0, LAST_INPUT), pressed=pressed, free=free)

    def open(self, buses: Buses, called: str) -> Switch:
        """Connects the switch to the board's input."""
        assert buses.analogue is not None
        buses.analogue.connect({self.channel: f"the switch of {called}"})
        return Switch(self, buses.analogue, called)


class Switch(OnInputs):
    """One switch on an analogue input.

    Args:
        settings: Input of the switch, and its volts.
        inputs: Inputs of the board.
        called: Name of the part that the switch is on.
    """

    name = SwitchSettings.name

    def __init__(self, settings: SwitchSettings, inputs: AnalogueInputs, called: str):
        super().__init__(inputs, settings.channels)
        self._settings = settings
        self._called = called
        self._volts = settings.free
        self._pressed = False

    def load(self) -> bool:
        """Whether it is pressed, at the moment when the other analogue sensors were read."""
        self._volts = self._inputs.same_moment()[self._settings.channel]
        share = self._share()
        self._pressed = share > (_OFF if self._pressed else _ON)
        return self._pressed

    def check(self) -> None:
        """Checks that the latest reading can be one of the switch.

        Raises:
            DeviceDataError: The voltage is far outside pressed and free, stuck, or at an end of the
                range.
        """
        super().check()
        if not -_OVERSHOOT <= self._share() <= 1 + _OVERSHOOT:
            raise DeviceDataError(
                f"The switch of {self._called} has {self._volts:.2f} V, and pressed "
                f"{self._settings.pressed:g} V, free {self._settings.free:g} V.",
                "Look for a wire that has come off, and at its resistors.",
            )

    def _share(self) -> float:
        free, pressed = self._settings.free, self._settings.pressed
        return (self._volts - free) / (pressed - free)
