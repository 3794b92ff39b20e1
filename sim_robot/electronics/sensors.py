"""What lies between the body and the sensors' inputs: gauges that fail, sensors that shift.

No daemon can notice any of these faults: each reading is one that some pose gives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar, Final

from sim_robot.electronics.fault_switch import Fault, FaultSwitch

_STUCK_LOAD: Final = 2.0  # N, of a gauge that is stuck: a leg's share of a robot's weight


class Sensors(FaultSwitch):
    """The gauges, the accelerometer and the distance sensor as they are mounted.

    Args:
        gauges: Number of gauges.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        "deaf": Fault("the n-th gauge feels no load"),
        "pressed": Fault("the n-th gauge feels a load in every pose"),
        "tilt_left": Fault("the accelerometer is turned: by n degrees the left side seems up"),
        "tilt_forward": Fault("the accelerometer is turned: by n degrees the nose seems up"),
        "too_high": Fault("the distance sensor reads n millimetres too much"),
    }

    def __init__(self, gauges: int) -> None:
        super().__init__()
        self._gauges = gauges

    def numbers(self, fault: str) -> Sequence[int]:
        """Numbers that a fault may have: of a gauge, from 1; degrees; or millimetres."""
        if fault in ("deaf", "pressed"):
            return range(1, self._gauges + 1)
        limit = 50 if fault == "too_high" else 45
        return [*range(-limit, 0), *range(1, limit + 1)]

    def load(self, gauge: int, newtons: float) -> float:
        """Load that a gauge, by its index, feels of a load of so many newtons, N."""
        faults = self.faults
        if faults.get("deaf") == gauge + 1:
            return 0.0
        return _STUCK_LOAD if faults.get("pressed") == gauge + 1 else newtons

    @property
    def turned(self) -> tuple[float, float]:
        """Angles by which the left side, and the nose, seem up, degrees."""
        faults = self.faults
        return faults.get("tilt_left", 0), faults.get("tilt_forward", 0)

    @property
    def too_high(self) -> int:
        """Excess of what the distance sensor reads, mm."""
        return self.faults.get("too_high", 0)
