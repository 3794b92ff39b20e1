"""Faults of the world: a body that is damaged while it runs, and ground that is not level.

``world.damage`` makes the damaged body.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, Final

from protocol.wire.readings import up_of
from sim_robot.electronics.fault_switch import Fault, FaultSwitch

if TYPE_CHECKING:
    from sim_robot.world.body import Body

_STEEPEST: Final = 10
_SLOPES: Final = (*range(-_STEEPEST, 0), *range(1, _STEEPEST + 1))


class Damage(FaultSwitch):
    """Damages of a body: of each kind one, to the leg of the motor that the fault's number tells.

    Args:
        body: The body without damages.
        damaged: Returns a body with one damage more, given the body, the kind of damage, the number
            of the leg's motor, and the amount.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        "cut": Fault(
            "of the n-th motor's leg so many percent are left, the rest broke off",
            amounts=(5.0, 95.0),
        ),
        "length": Fault(
            "the n-th motor's leg has so many percent of its length, foot and all",
            amounts=(20.0, 300.0),
        ),
        "bent": Fault(
            "the n-th motor's leg is bent by so many degrees at half its length",
            amounts=(-90.0, 90.0),
        ),
        "twisted": Fault(
            "the n-th motor's hinge is turned by so many degrees about its leg",
            amounts=(-90.0, 90.0),
        ),
        "aside": Fault(
            "the n-th motor's leg points so many degrees to its left", amounts=(-90.0, 90.0)
        ),
        "weight": Fault(
            "so many grams hang at the end of the n-th motor's leg", amounts=(1.0, 1000.0)
        ),
    }

    def __init__(self, body: Body, damaged: Callable[[Body, str, int, float], Body]) -> None:
        super().__init__()
        self._undamaged = body
        self._damaged = damaged
        self._applied: dict[str, tuple[int, float]] = {}

    def numbers(self, fault: str) -> Sequence[int]:
        """Numbers of the motors, from 1."""
        return range(1, len(self._undamaged.motors) + 1)

    def new_body(self) -> Body | None:
        """The body with its damages; ``None`` if these have not changed since the last call."""
        damages = {fault: (number, self.amount(fault)) for fault, number in self.faults.items()}
        if damages == self._applied:
            return None
        self._applied = damages
        body = self._undamaged
        for fault, (number, amount) in damages.items():
            body = self._damaged(body, fault, number, amount)
        return body


class Ground(FaultSwitch):
    """The plane that the robot lies on."""

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        "rises_left": Fault(
            "the ground rises by n degrees to the left of the robot's first heading"
        ),
        "rises_forward": Fault("the ground rises by n degrees towards the robot's first heading"),
    }

    def numbers(self, fault: str) -> tuple[int, ...]:
        """Slopes that a fault may have, degrees."""
        del fault
        return _SLOPES

    @property
    def up(self) -> tuple[float, float, float]:
        """The direction against gravity, of length 1, in a frame whose z axis is normal to it."""
        slopes = self.faults
        left, forward = (slopes.get(name, 0) for name in self.FAULTS)
        return up_of((math.radians(left), math.radians(forward)))
