"""When a simulated body rests, so that the rest of the steps can be left out."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from estimator.physics.base import WorldSettings


class RestWatch:
    """Sees when a simulated body rests: at several looks, some steps apart, it hardly moved.

    Args:
        settings: The world; where all steps are wanted, nothing ever rests.
    """

    STEPS_PER_LOOK: Final = 4
    _LOOKS: Final = 4
    _REST_SPEED: Final = 2e-4  # m/s
    _REST_SPIN: Final = 2e-3  # rad/s

    def __init__(self, settings: WorldSettings):
        self._full_steps = settings.full_steps
        self._calm = 0

    @property
    def rests(self) -> bool:
        """Whether the body rests."""
        return self._calm >= self._LOOKS and not self._full_steps

    def look(self, velocity: Iterable[float], spin: Iterable[float]) -> None:
        """Looks at the velocity, m/s, and the angular velocity, rad/s, of the main body."""
        still = math.hypot(*velocity) < self._REST_SPEED and math.hypot(*spin) < self._REST_SPIN
        self._calm = self._calm + 1 if still else 0
