"""A switch with its resistor on an analogue input: a foot that is pressed or free.

A resistor to the supply, or to ground, gives the input one voltage while the switch is open and
another while it is closed. With a second resistor across the switch neither of them is that of a
wire that has come off, which is then noticed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

from robot.drivers.buses import Buses
from robot.drivers.links.analogue_inputs import AnalogueInputs
from robot.drivers.sensors.analogue import OnInputs
from robot.errors import DeviceDataError
from robot.toml_sections import Section

LEAST_CHANGE: Final = 0.3  # V
_ON: Final = 0.6  # shares of the way from free to pressed
_OFF: Final = 0.4
_BEYOND: Final = 0.3


@dataclass(frozen=True, kw_only=True)
class SwitchSettings:
    """The input, and its volts with the foot pressed and free."""

    name: ClassVar[str] = "switch"
    channel: int
    pressed: float
    free: float

    @property
    def channels(self) -> tuple[int, ...]:
        """Its one input."""
        return (self.channel,)

    @classmethod
    def read(cls, table: Section) -> SwitchSettings:
        """``channel``, ``pressed_v`` and ``free_v``."""
        pressed, free = table.number("pressed_v", -10, 10), table.number("free_v", -10, 10)
        if abs(pressed - free) < LEAST_CHANGE:
            raise table.refuse(
                "pressed_v",
                f"must differ from free_v, {free:g}, by {LEAST_CHANGE:g} volts at least, "
                f"not be {pressed:g}.",
            )
        return cls(channel=table.integer("channel", 0, 31), pressed=pressed, free=free)

    def open(self, buses: Buses, called: str) -> Switch:
        """Connects the switch to the board's input."""
        assert buses.analogue is not None
        buses.analogue.connect({self.channel: f"the switch of {called}"})
        return Switch(self, buses.analogue, called)

    def __str__(self) -> str:
        return f"analogue input {self.channel}"


class Switch(OnInputs):
    """One switch.

    Args:
        settings: Its input and volts.
        inputs: The board's.
        called: The part that it is on.
    """

    name = SwitchSettings.name

    def __init__(self, settings: SwitchSettings, inputs: AnalogueInputs, called: str):
        super().__init__(inputs, settings.channels)
        self._settings = settings
        self._inputs = inputs
        self._called = called
        self._volts = settings.free
        self._pressed = False

    def load(self) -> bool:
        """Whether it is pressed, at the moment at which the other analogue sensors were read."""
        self._volts = self._inputs.same_moment()[self._settings.channel]
        share = self._share()
        self._pressed = share > (_OFF if self._pressed else _ON)
        return self._pressed

    def check(self) -> None:
        """Whether the latest reading is one of a switch.

        Raises:
            DeviceDataError: It is far from both voltages, stuck, or at an end of the range.
        """
        super().check()
        if not -_BEYOND <= self._share() <= 1 + _BEYOND:
            raise DeviceDataError(
                f"The switch of {self._called} has {self._volts:.2f} V, and pressed "
                f"{self._settings.pressed:g} V, free {self._settings.free:g} V.",
                "Look for a wire that has come off, and at its resistors.",
            )

    def _share(self) -> float:
        free, pressed = self._settings.free, self._settings.pressed
        return (self._volts - free) / (pressed - free)
