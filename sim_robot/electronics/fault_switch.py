"""Faults that can be switched on and off while an emulator runs."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

from robot.errors import CommandError


class FaultSwitch:
    """Base of what can fail: named faults, each with a number where it needs one.

    Attributes:
        FAULTS: What each lasting fault does, by name; subclasses fill it in.
        EVENTS: What happens once and is over, by name, likewise.
    """

    FAULTS: ClassVar[Mapping[str, str]] = MappingProxyType({})
    EVENTS: ClassVar[Mapping[str, str]] = MappingProxyType({})

    def __init__(self) -> None:
        self._faults: dict[str, int] = {}

    @property
    def faults(self) -> Mapping[str, int]:
        """The faults that are on, with their numbers."""
        return dict(self._faults)

    def inject(self, fault: str, value: int = 0) -> None:
        """Switches a fault on, or makes an event happen; may be called from any thread.

        Raises:
            CommandError: There is no such fault here.
        """
        if fault in self.EVENTS:
            self._happen(fault, value)
        elif fault in self.FAULTS:
            self._faults[fault] = value
        else:
            known = ", ".join([*self.FAULTS, *self.EVENTS])
            raise CommandError(f"the faults here are {known}, not {fault!r}")

    def mend(self, fault: str | None = None) -> None:
        """Switches a fault off, or all of them."""
        if fault is None:
            self._faults.clear()
        else:
            self._faults.pop(fault, None)

    def _happen(self, event: str, value: int) -> None:
        """Makes an event happen; called with a key of ``EVENTS``."""
