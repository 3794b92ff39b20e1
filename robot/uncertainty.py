"""How well something was calibrated: the standard deviations that a calibration states of itself.

A value that nobody states is left out, in a file, in ``hello`` and here; it is not taken for 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from robot.toml_sections import Section

_LEAST: Final = 1e-3  # degrees, mm: less than anybody can measure
_MOST: Final = 20.0  # degrees, mm: more is no calibration
_GAINS: Final = (1e-4, 0.5)


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """Standard deviations of a calibration.

    Attributes:
        zero: Standard deviation of the zero, rad or m; ``None``: nobody states it.
        gain: Standard deviation of the gain, as a fraction of it; ``None``: nobody states it.
    """

    zero: float | None = None
    gain: float | None = None

    @classmethod
    def read(cls, section: Section, zero: str, gain: str) -> Uncertainty:
        """Reads two keys, each of which may be absent; the key ``zero`` ends in _deg or _mm.

        Raises:
            ConfigError: Names file, key and reason.
        """
        stated = section.number(zero, _LEAST, _MOST) * _unit(zero) if section.has(zero) else None
        return cls(zero=stated, gain=section.number(gain, *_GAINS) if section.has(gain) else None)

    def written(self, zero: str, gain: str) -> Iterator[tuple[str, float]]:
        """Yields the keys and values that ``read`` reads; values out of its range are clamped."""
        for key, value, least, most in (
            (zero, self.zero and self.zero / _unit(zero), _LEAST, _MOST),
            (gain, self.gain, *_GAINS),
        ):
            if value is not None:
                yield key, min(max(value, least), most)


def _unit(key: str) -> float:
    """Factor from the unit of a key to rad or m."""
    return math.radians(1.0) if key.endswith("_deg") else 1e-3
