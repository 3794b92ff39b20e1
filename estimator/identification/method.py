"""The interfaces between a run and its method, and between a run and its listener."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import ClassVar, Protocol

from estimator.physics.base import ArrayPhysics
from estimator.posterior.fitted import FittedPosterior
from estimator.readings.observation import Observation
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore
from estimator.workplaces import Executors
from protocol.errors import RobotError


class Method(Protocol):
    """Learns from one interaction after the other; what it has learnt is safe on disk.

    A method begins where its run's store says that it stands.

    Args:
        store: The run's memory; opened for writing.
        executors: Executors that do the work.
        listener: Hears what happens.
        stack: Closes in the end what is opened here.

    Attributes:
        PHYSICS: Name of the back-end that it works with by default.
        RULE: Name of the exploration rule that chooses its motor programs by default.
        choosing: Back-end with which motor programs are chosen.
    """

    PHYSICS: ClassVar[str]
    RULE: ClassVar[str]
    choosing: ArrayPhysics

    def __init__(
        self, store: RunStore, executors: Executors, listener: Listener, stack: ExitStack
    ) -> None: ...

    @staticmethod
    def check(config: RunConfig) -> None:
        """Refuses settings that the method has no use for.

        Raises:
            EstimatorError: The config has such a setting.
        """

    def work(self, number: int) -> float:
        """Amount of work after an interaction, in any unit."""

    def done(self, number: int) -> float:
        """Amount of the work after an interaction that is on disk already."""

    def learn(self, number: int, observations: Sequence[Observation]) -> None:
        """Learns from an interaction; what was learnt before a crash is not learnt again.

        Args:
            number: Number of the interaction, from 0.
            observations: Observations of all interactions so far.
        """

    def posterior(self) -> FittedPosterior:
        """What is known of the body by now; random bodies before the first interaction."""

    def is_sure(self, number: int) -> bool:
        """Whether the settings ask for no further interaction after this one."""

    def finish(self, observations: Sequence[Observation]) -> None:
        """Checks the result with the reference back-end, unless that is done already."""


class Listener:
    """Hears what happens in a run; every method may be overridden, and does nothing here."""

    def say(self, sentence: str) -> None:
        """Called with a sentence that a person should know."""

    def expect(self, work: float, done: float) -> None:
        """Called with the amount of work in all, in any unit, and what of it is done already."""

    def worked(self, work: float, what: str) -> None:
        """Called when some work is done, and safe on disk; ``what`` says where the run stands."""

    def chosen(self, number: int, reason: str, bits: float | None) -> None:
        """Called when a motor program was chosen: why, and its expected information, bits."""

    def moving(self, number: int, phase: str, fraction: float) -> None:
        """Called with how far an interaction is: its phase, and the share of it done, 0 to 1."""

    def observed(self, number: int, observation: Observation) -> None:
        """Called when an interaction is over and its observation safe on disk."""

    def may_retry(self, error: RobotError) -> bool:
        """Whether to ask the robot again, now that a person has done what ``error`` advises."""
        return False


def information_in_words(bits: float) -> str:
    """Says in words how much information, bits, a movement is expected to give."""
    if bits < 1:
        return f"it is expected to rule out {100 * (1 - 0.5**bits):.0f} % of the possibilities"
    return f"it is expected to leave one possibility in {2**bits:.0f}"
