"""A switch on a GPIO line, such as a micro switch in a foot, between the line and ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from robot.drivers.buses import Buses
from robot.drivers.links.gpio import PULLS, GPIODevices, GPIOLine, LinePlace, input_line
from robot.errors import CommandError
from robot.toml_sections import Section


@dataclass(frozen=True, kw_only=True)
class GPIOSwitchSettings:
    """Line of a switch, and its level while the switch is pressed.

    Attributes:
        place: Where the line is.
        pull: What holds the line while the switch is open, one of ``PULLS``.
        active_low: Whether the line is low while the switch is pressed.
        debounce: How long a level must last to count, s: the kernel leaves out what is shorter.
    """

    name: ClassVar[str] = "GPIO switch"
    channels: ClassVar[tuple[int, ...]] = ()
    place: LinePlace
    pull: str
    active_low: bool
    debounce: float

    @classmethod
    def read(cls, table: Section) -> GPIOSwitchSettings:
        """Reads the keys ``chip``, ``line``, ``pressed``, ``pull`` and ``debounce_ms``."""
        pressed = table.choice("pressed", ("low", "high"), "low")
        usual_pull, wrong_pull = ("up", "down") if pressed == "low" else ("down", "up")
        pull = table.choice("pull", PULLS, usual_pull)
        if pull == wrong_pull:
            raise table.refuse(
                "pull",
                f"is {pull}, and the line {pressed} while pressed: it would be {pressed} all the "
                f"time. Write {usual_pull}, or none where the line has a resistor of its own.",
            )
        return cls(
            place=LinePlace.read(table),
            pull=pull,
            active_low=pressed == "low",
            debounce=table.number("debounce_ms", 0, 100, 5) / 1000,
        )

    @property
    def claims(self) -> tuple[str, ...]:
        """The line that the switch occupies."""
        return (f"GPIO {self.place}",)

    def open(self, buses: Buses, called: str) -> GPIOSwitch:
        """Driver of the switch; its ``start`` opens the line."""
        del called
        return GPIOSwitch(self, buses.gpio)

    def __str__(self) -> str:
        return f"GPIO {self.place}"


class GPIOSwitch:
    """One switch. An open line looks like an open switch: nobody can tell that a wire came off.

    Args:
        settings: Line of the switch.
        devices: The computer's GPIO chips.
    """

    name = GPIOSwitchSettings.name

    def __init__(self, settings: GPIOSwitchSettings, devices: GPIODevices):
        self._settings = settings
        self._devices = devices
        self._line: GPIOLine | None = None

    def start(self) -> None:
        """Opens the line, anew after a fault.

        Raises:
            DeviceMissingError: There is no such line, it is in use, or the user may not use it.
        """
        self.close()
        settings = self._settings
        self._line = input_line(
            self._devices,
            settings.place,
            pull=settings.pull,
            active_low=settings.active_low,
            debounce=settings.debounce,
        )

    def load(self) -> bool:
        """Whether the switch is pressed.

        Raises:
            DeviceMissingError: The line cannot be read any more.
        """
        if self._line is None:
            raise CommandError("start the switch before reading it")
        return self._line.get()

    def check(self) -> None:
        """Does nothing: either level can be right."""

    def close(self) -> None:
        """Gives the line back."""
        line, self._line = self._line, None
        if line is not None:
            line.close()
