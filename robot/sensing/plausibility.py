"""Readings that cannot be, from sensors that still answer.

A device that is silent is noticed by its driver. One that keeps talking is only noticed by what it
says: an input with a broken wire sits at an end of its range; a live 16-bit input, which dithers,
does not give the same code again and again; a body that leans cannot have its belly on the ground.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from robot.errors import DeviceDataError

STUCK_AFTER: Final = 20
"""Scans with exactly the same code after which an input is stuck; settling alone takes more.

An accelerometer's noise is some 5 codes at ±5 V, an amplified gauge's more, a converter's alone 1.
"""

LEAST_MARGIN: Final = 0.010
"""Metres by which distance and tilt may contradict each other in any case."""

_DISTANCE_SIGMAS: Final = 10.0
_TILT_SIGMAS: Final = 5.0
_CODES: Final = 65536
_STEEPEST: Final = math.cos(math.radians(60))  # beyond it, 1° of tilt is worth too many metres


class ChannelWatch:
    """Looks for analogue inputs that are no longer alive.

    Args:
        names: What is connected, by channel.
        first: The channel of the first value that is fed.
        rails: The volts at the ends of the input range, or ``None`` not to look for them.
    """

    def __init__(self, names: Mapping[int, str], *, first: int, rails: tuple[float, float] | None):
        self._names = {channel - first: (name, channel) for channel, name in names.items()}
        self._last = dict.fromkeys(self._names, math.nan)
        self._repeats = dict.fromkeys(self._names, 0)
        self._low, self._high = -math.inf, math.inf
        if rails is not None:
            code = (rails[1] - rails[0]) / _CODES
            self._low, self._high = rails[0] + code / 2, rails[1] - 1.5 * code

    def feed(self, volts: Sequence[float]) -> None:
        """Takes one scan."""
        for index in self._names:
            same = volts[index] == self._last[index]
            self._repeats[index] = self._repeats[index] + 1 if same else 1
            self._last[index] = volts[index]

    def check(self, volts: Sequence[float]) -> None:
        """Whether a scan of the resting robot can be believed.

        Raises:
            DeviceDataError: A channel is at an end of its range, or stuck.
        """
        for index, (name, channel) in self._names.items():
            if not self._low < volts[index] < self._high:
                raise DeviceDataError(
                    f"Input {channel}, {name}, is at the end of its range ({volts[index]:.3f} V).",
                    "Look for a broken wire, a short circuit or an amplifier without supply.",
                )
            if self._repeats[index] >= STUCK_AFTER:
                raise DeviceDataError(
                    f"Input {channel}, {name}, is stuck: it gave exactly {volts[index]:.5f} V "
                    f"{self._repeats[index]} times running.",
                    "Look for a short circuit, and at the analogue inputs of the DMM-32.",
                )


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

    def check(self, clearance: float, tilt: tuple[float, float]) -> None:
        """Whether a clearance can go with a tilt: no corner of the belly is below the ground.

        Args:
            clearance: Belly to ground, m.
            tilt: Left/right and forward/back, rad.

        Raises:
            DeviceDataError: It cannot.
        """
        across, along = abs(math.sin(tilt[0])), abs(math.sin(tilt[1]))
        upright = math.sqrt(max(0.0, 1.0 - across**2 - along**2))
        if upright < _STEEPEST:
            return
        least = (self.length * along + self.width * across) / 2 / upright
        if clearance < least - self.margin:
            lean = math.degrees(math.acos(upright))
            raise DeviceDataError(
                f"The distance sensor says {clearance * 1000:.0f} mm, but the belly of a body that "
                f"leans by {lean:.0f}° is at least {least * 1000:.0f} mm up.",
                "One of the two is wrong: check the distance sensor, then the accelerometer.",
            )
