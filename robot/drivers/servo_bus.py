"""What moves the joints: the seam between the choreography and a servo board's driver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol


class ServoBus(Protocol):
    """What is needed of a servo board."""

    def set_counts(self, counts: Mapping[int, int]) -> None:
        """Commands outputs 1..8 to counts 1..255; a board that was reset ignores it."""

    def read_counts(self, outputs: Sequence[int]) -> dict[int, int]:
        """The counts that the board holds."""

    def release(self, outputs: Sequence[int]) -> None:
        """Lets outputs go limp."""

    def verify(self, expected: Mapping[int, int]) -> list[int]:
        """Outputs whose count on the board is not the expected one; raises after a reset."""

    def forget(self) -> None:
        """Takes the board, reset or not, as the next ``read_counts`` finds it."""

    def seconds_for(self, changed: int) -> float:
        """How long ``set_counts`` takes for so many outputs, s."""
