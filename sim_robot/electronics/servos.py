"""What lies between the servo board's outputs and the joints: plugs and servos that can fail.

Hobby servos answer nothing, so no daemon can notice any of these faults by itself; with servos that
say where they are it can.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Final, NamedTuple

from sim_robot.electronics.fault_switch import Fault, FaultSwitch

_PLAY: Final = 0.05
"""Share of its count by which a blocked servo turns, either way."""


class Felt(NamedTuple):
    """What a servo measures: its position, in counts, and the share of its torque that it gives."""

    position: float
    torque: float


class Servos(FaultSwitch):
    """The servos of one robot and their plugs.

    Args:
        count: Number of servos, one at each of the board's outputs.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        "dead": Fault("the motor of the n-th servo gets no power and goes limp"),
        "jammed": Fault("the n-th servo stays where it is when the fault begins"),
        "blocked": Fault(
            "the n-th servo turns only by some degrees from where it is when the fault begins"
        ),
        "swapped": Fault("the n-th servo and the next one have exchanged their plugs"),
        "slipped": Fault(
            "the n-th servo's horn has slipped by so many degrees", amounts=(-45.0, 45.0)
        ),
        "short": Fault("every servo stops n degrees short of where it is told", range(1, 11)),
        "travel": Fault(
            "the n-th servo turns so many percent as far as it is told", amounts=(20.0, 200.0)
        ),
    }

    def __init__(self, count: int) -> None:
        super().__init__()
        self._count = count
        self._last_driven: tuple[int, ...] = ()
        self._angles = [0.0] * count  # to which the servos brought their joints last, rad

    def numbers(self, fault: str) -> Sequence[int]:
        """Degrees, or servos, from 1; the last has no neighbour to exchange plugs with."""
        if fault == "short":
            return self.FAULTS[fault].numbers
        return range(1, self._count + (fault != "swapped"))

    def carry(self, pulses: Sequence[int]) -> tuple[int, ...]:
        """The pulses that the servos follow when the board sends ``pulses``; 0 is limp."""
        driven = list(pulses)
        faults = self.faults
        _swap(driven, faults)
        for name, play in (("jammed", 0.0), ("blocked", _PLAY)):
            if name in faults:
                servo = faults[name] - 1
                count = self._held.setdefault(name, (self._last_driven or driven)[servo])
                if count and driven[servo]:
                    room = round(play * count)
                    driven[servo] = min(max(driven[servo], count - room), count + room)
                elif name == "jammed":
                    driven[servo] = count
        if "dead" in faults:
            driven[faults["dead"] - 1] = 0
        self._last_driven = tuple(driven)
        return self._last_driven

    def turned(self, index: int, angle: float) -> float:
        """Angle to which a servo, by its index, brings its joint if told ``angle``, rad."""
        faults = self.faults
        if faults.get("travel") == index + 1:
            angle *= self.amount("travel") / 100
        if faults.get("slipped") == index + 1:
            angle += math.radians(self.amount("slipped"))
        short = math.radians(faults.get("short", 0))
        angle = min(max(self._angles[index], angle - short), angle + short)
        self._angles[index] = angle
        return angle

    def angle_of(self, index: int, angle: float) -> float:
        """Angle of a servo itself, by its index, while its joint stands at ``angle``, rad."""
        faults = self.faults
        if faults.get("slipped") == index + 1:
            angle -= math.radians(self.amount("slipped"))
        if faults.get("travel") == index + 1:
            angle *= 100 / self.amount("travel")
        return angle

    def feel(self, pulses: Sequence[int], felt: Sequence[Felt]) -> list[Felt]:
        """What the servos measure while commanded to ``pulses``, in the order of the outputs.

        Args:
            pulses: Pulses that the board sends, as for ``carry``.
            felt: What the world has at each joint; where a joint is held, without the torque with
                which its servo pushes in vain.
        """
        measured, faults = list(felt), self.faults
        _swap(measured, faults)
        for name in ("jammed", "blocked"):
            servo = faults.get(name, 0) - 1
            if servo >= 0 and pulses[servo] and abs(pulses[servo] - measured[servo].position) > 1:
                torque = 1.0 if pulses[servo] > measured[servo].position else -1.0
                measured[servo] = measured[servo]._replace(torque=torque)
        if "dead" in faults:
            servo = faults["dead"] - 1
            measured[servo] = measured[servo]._replace(torque=0.0)
        return measured


def _swap(outputs: list[Any], faults: Mapping[str, int]) -> None:
    """Exchanges what is at two neighbouring outputs, where their plugs are."""
    if "swapped" in faults:
        first = faults["swapped"]
        outputs[first - 1], outputs[first] = outputs[first], outputs[first - 1]
