"""What a check of a robot or of a problem finds."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Final


class Fitness(Enum):
    """How serious the result of a check is."""

    FINE = "fine"
    NOTE = "note"
    BAD = "bad"


@dataclass(frozen=True)
class ExaminedItem:
    """The result of one check."""

    verdict: Fitness
    subject: str
    sentence: str


fine: Final = partial(ExaminedItem, Fitness.FINE)
"""A finding that all is well."""

note: Final = partial(ExaminedItem, Fitness.NOTE)
"""A finding that hinders nothing, and that somebody should know of."""

bad: Final = partial(ExaminedItem, Fitness.BAD)
"""A finding that hinders."""
