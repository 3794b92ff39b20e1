"""The three axes of an accelerometer, with their calibration in the unit that it gives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Final

from robot.toml_sections import Section

AXIS_KEYS: Final = MappingProxyType({"V": ("zero_v", "volts_per_g"), "g": ("zero_g", "g_per_g")})
"""By unit, the keys of what an axis reads at 0 g, and of what it reads more at 1 g."""

_ZEROS: Final = MappingProxyType({"V": 10.0, "g": 0.5})
_GAINS: Final = MappingProxyType({"V": (0.02, 5.0), "g": (0.5, 2.0)})


@dataclass(frozen=True, kw_only=True)
class CalibratedAxes(ABC):
    """Settings of an accelerometer that ``robotd calibrate`` can calibrate; its driver has ``raw``.

    Attributes:
        unit: What ``raw`` gives: ``V`` or ``g``.
        zero: What it gives at 0 g along x (forward), y (left), z (up).
        per_g: How much more it gives at 1 g; negative where an axis points the other way.
    """

    unit: ClassVar[str]
    zero: tuple[float, ...]
    per_g: tuple[float, ...]

    def acceleration(self, raw: Sequence[float]) -> tuple[float, float, float]:
        """Acceleration along x, y, z in g."""
        triples = zip(raw, self.zero, self.per_g, strict=True)
        x, y, z = ((value - zero) / gain for value, zero, gain in triples)
        return x, y, z

    @abstractmethod
    def axis(self, index: int) -> str:
        """Where the axis x, y or z comes from, for a sentence."""

    @property
    @abstractmethod
    def key(self) -> str:
        """The key of ``robot.toml`` that says so."""


def read_axes(table: Section, unit: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """What the axes read at 0 g and per g, in their unit."""
    zero, gain = AXIS_KEYS[unit]
    gains = table.magnitudes(gain, 3, *_GAINS[unit])
    return table.numbers(zero, 3, -_ZEROS[unit], _ZEROS[unit]), gains
