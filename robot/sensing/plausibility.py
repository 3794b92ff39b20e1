"""Readings that cannot go together: a body that leans cannot have its belly on the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from protocol.wire.readings import up_of
from robot.errors import DeviceDataError

LEAST_MARGIN: Final = 0.010
"""Metres by which distance and tilt may contradict each other in any case."""

_DISTANCE_SIGMAS: Final = 10.0
_TILT_SIGMAS: Final = 5.0
_STEEPEST: Final = math.cos(math.radians(60))  # beyond it, 1° of tilt is worth too many metres


@dataclass(frozen=True, kw_only=True)
class Underside:
    """The belly, against which distance and tilt are held.

    Attributes:
        length: Along x, m.
        width: Along y, m.
        margin: Metres by which distance and tilt may contradict each other.
    """

    length: float
    width: float
    margin: float = LEAST_MARGIN

    @classmethod
    def of(cls, size: Sequence[float], *, tilt_noise: float, clearance_noise: float) -> Underside:
        """That of a body, with a margin for readings that err as they are announced to.

        Args:
            size: Of the main body along x, y, z, m.
            tilt_noise: Root mean square error of one observation, rad.
            clearance_noise: Likewise, m.
        """
        length, width = size[:2]
        lifted = _TILT_SIGMAS * tilt_noise * (length + width) / 2
        margin = max(LEAST_MARGIN, _DISTANCE_SIGMAS * clearance_noise + lifted)
        return cls(length=length, width=width, margin=margin)

    def check(self, clearance: float, tilt: tuple[float, float], *, sensor: str) -> None:
        """Whether a clearance can go with a tilt: no corner of the belly is below the ground.

        Args:
            clearance: Belly to ground, m.
            tilt: Left/right and forward/back, rad.
            sensor: What the distance sensor is called.

        Raises:
            DeviceDataError: It cannot.
        """
        along, across, upright = map(abs, up_of(tilt))
        if upright < _STEEPEST:
            return
        least = (self.length * along + self.width * across) / 2 / upright
        if clearance < least - self.margin:
            lean = math.degrees(math.acos(upright))
            raise DeviceDataError(
                f"The distance sensor ({sensor}) says {clearance * 1000:.0f} mm, but the belly of "
                f"a body that leans by {lean:.0f}° is at least {least * 1000:.0f} mm up.",
                "One of the two is wrong: check the distance sensor, then the accelerometer.",
            )
