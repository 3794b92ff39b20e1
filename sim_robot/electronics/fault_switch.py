"""Faults that can be switched on and off while an emulator runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final

from robot.errors import CommandError

EVERY_NTH: Final = range(10**9)
"""Numbers n of a fault that strikes every n-th time; 0, like 1, is every time."""


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Attributes:
        effect: What it does.
        numbers: Numbers that it may have; 0 stands for none.
        amounts: Least and largest amount, of one that takes an amount as well.
        once: Whether it is an event, which happens once and is over, and does not last.
    """

    effect: str
    numbers: range = range(1)
    amounts: tuple[float, float] = (0.0, 0.0)
    once: bool = False


class FaultSwitch:
    """Base class of what can fail: named faults, each with a number where it needs one.

    Attributes:
        FAULTS: Faults by name; subclasses fill it in.
    """

    FAULTS: ClassVar[Mapping[str, Fault]]

    def __init__(self) -> None:
        self._faults: dict[str, int] = {}
        self._amounts: dict[str, float] = {}
        self._held: dict[str, Any] = {}  # of a fault, by name, what stays as it was when it began

    @property
    def faults(self) -> Mapping[str, int]:
        """The faults that are on, with their numbers."""
        return dict(self._faults)

    def amount(self, fault: str) -> float:
        """Amount of a fault; 0 for one that takes no amount."""
        return self._amounts.get(fault, 0.0)

    def inject(self, fault: str, value: int = 0, amount: float = 0.0) -> None:
        """Switches a fault on, or makes an event happen; may be called from any thread.

        Raises:
            CommandError: The fault cannot be injected; see ``check``.
        """
        self.check(fault, value, amount)
        if self.FAULTS[fault].once:
            self._happen(fault, value)
        else:
            if self._faults.get(fault) != value:
                self.mend(fault)  # what it kept was of another number
            self._amounts[fault] = amount  # first: others look at the faults at any time
            self._faults[fault] = value

    def check(self, fault: str, value: int, amount: float = 0.0) -> None:
        """Finds out whether a fault can be injected.

        Args:
            fault: Name of the fault or event.
            value: Number of the fault, 0 for none.
            amount: Amount of the fault, 0 where it takes none.

        Raises:
            CommandError: There is no such fault here, or none of this number or amount.
        """
        if fault not in self.FAULTS:
            raise CommandError(f"the faults here are {', '.join(self.FAULTS)}, not {fault!r}")
        numbers = self.numbers(fault)
        if value not in numbers:
            if isinstance(numbers, range):
                needed = f"a number from {numbers[0]} to {numbers[-1]}"
            else:
                needed = f"one of the numbers {', '.join(map(str, numbers))}"
            hint = f"not {value}" if value else f"as in {fault}={numbers[-1]}"
            raise CommandError(
                f"{fault} needs {needed}, {hint}"
                if numbers[-1]
                else f"{fault} takes no number; leave out ={value}"
            )
        least, most = self.FAULTS[fault].amounts
        if not least <= amount <= most or (least < most and not amount):
            raise CommandError(
                f"{fault} needs an amount from {least:g} to {most:g}, as in "
                f"{fault}={value}:{most:g}"
                if most
                else f"{fault} takes no amount; leave out :{amount:g}"
            )

    def numbers(self, fault: str) -> Sequence[int]:
        """The numbers that a fault may have; 0 stands for none."""
        return self.FAULTS[fault].numbers

    def mend(self, fault: str | None = None) -> None:
        """Switches a fault off, or all of them."""
        if fault is None:
            self._faults.clear()
            self._held.clear()
        else:
            self._faults.pop(fault, None)
            self._held.pop(fault, None)

    def _strikes(self, fault: str, count: int) -> bool:
        """Whether a fault that strikes every n-th time strikes at the count-th."""
        nth = self._faults.get(fault)
        return nth is not None and count % max(nth, 1) == 0

    def _happen(self, event: str, value: int) -> None:
        """Makes an event happen; called with the name of one."""
