"""The seven experimental variants: which modalities count, in the order of Figure 3's caption."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One experimental variant.

    Attributes:
        number: Its column in Figure 3, from 1.
        modalities: Modalities that the subjective error counts.
    """

    number: int
    modalities: tuple[str, ...]

    @property
    def name(self) -> str:
        """Short name, fit for a directory."""
        return "+".join(self.modalities)


VARIANTS: Final = tuple(
    Variant(number=number, modalities=modalities)
    for number, modalities in enumerate(
        (
            ("touch", "tilt", "clearance"),
            ("tilt", "clearance"),
            ("touch", "clearance"),
            ("touch", "tilt"),
            ("touch",),
            ("tilt",),
            ("clearance",),
        ),
        start=1,
    )
)

ALL_MODALITIES: Final = VARIANTS[0]
TOUCH_AND_TILT: Final = VARIANTS[3]
