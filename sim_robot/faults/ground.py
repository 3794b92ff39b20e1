"""Ground that is not level, as a fault of the simulated robot's surroundings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Final

from protocol.wire.readings import up_of
from sim_robot.electronics.fault_switch import Fault, FaultSwitch

_STEEPEST: Final = 10
_SLOPES: Final = (*range(-_STEEPEST, 0), *range(1, _STEEPEST + 1))


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
