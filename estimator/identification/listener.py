"""What a run tells those who watch it."""

from __future__ import annotations

from estimator.readings.observation import Observation
from protocol.errors import RobotError


class Listener:
    """Hears what happens in a run; every method may be overridden, and does nothing here."""

    def say(self, sentence: str) -> None:
        """Something that a person should know."""

    def expect(self, work: float, done: float) -> None:
        """How much work there is in all, in any unit, and how much of it is done already."""

    def worked(self, work: float, what: str) -> None:
        """Some of the work is done, and safe on disk; ``what`` says where the run stands."""

    def chosen(self, number: int, reason: str, bits: float | None) -> None:
        """An interaction's motor program was chosen: why, and how much it should tell."""

    def moving(self, number: int, phase: str, fraction: float) -> None:
        """How far an interaction is: its phase and the share of it that is done, 0 to 1."""

    def observed(self, number: int, observation: Observation) -> None:
        """An interaction is over and its observation safe on disk."""

    def may_retry(self, error: RobotError) -> bool:
        """Whether to ask the robot again, now that a person has done what ``error`` advises."""
        return False
