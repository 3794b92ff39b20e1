"""What lies between the servo board's outputs and the joints: plugs and servos that can fail.

Servos answer nothing, so no daemon can notice any of these faults by itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar

from sim_robot.electronics.fault_switch import FaultSwitch


class Servos(FaultSwitch):
    """The servos of one robot and their plugs.

    Args:
        count: Of the servos, by the board's outputs.
    """

    FAULTS: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "dead": "the n-th servo gets no power and goes limp",
            "jammed": "the n-th servo stays where it is when the fault begins",
            "swapped": "the n-th servo and the next one have exchanged their plugs",
            "slipped": "the n-th servo's horn has slipped by so many degrees",
            "travel": "the n-th servo turns so many percent as far as it is told",
        }
    )

    AMOUNTS: ClassVar[Mapping[str, tuple[float, float]]] = MappingProxyType(
        {"slipped": (-45.0, 45.0), "travel": (20.0, 200.0)}
    )

    def __init__(self, count: int) -> None:
        super().__init__()
        self._count = count
        self._last: tuple[int, ...] = ()
        self._jammed: int | None = None

    def numbers(self, fault: str) -> Sequence[int]:
        """The servos from 1; the last has no neighbour to exchange plugs with."""
        return range(1, self._count + (fault != "swapped"))

    def carry(self, pulses: Sequence[int]) -> tuple[int, ...]:
        """The pulses that the servos follow when the board sends ``pulses``; 0 is limp."""
        driven = list(pulses)
        faults = self.faults
        swapped, dead, jammed = (faults.get(name) for name in ("swapped", "dead", "jammed"))
        if swapped is not None:
            driven[swapped - 1], driven[swapped] = driven[swapped], driven[swapped - 1]
        if dead is not None:
            driven[dead - 1] = 0
        if jammed is not None:
            if self._jammed is None:
                self._jammed = (self._last or driven)[jammed - 1]
            driven[jammed - 1] = self._jammed
        else:
            self._jammed = None
        self._last = tuple(driven)
        return self._last

    def turned(self, index: int, angle: float) -> float:
        """Where the servo of an index brings its joint that a pulse asks to an angle, rad."""
        faults = self.faults
        if faults.get("travel") == index + 1:
            angle *= self.amount("travel") / 100
        if faults.get("slipped") == index + 1:
            angle += math.radians(self.amount("slipped"))
        return angle
