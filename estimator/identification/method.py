"""What a method of modelling is: it learns from interactions, and gives a posterior."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import ClassVar, Protocol

from estimator.identification.listener import Listener
from estimator.physics.backends import Computers
from estimator.physics.base import ArrayMarginPhysics
from estimator.posterior.fitted import FittedPosterior
from estimator.readings.observation import Observation
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore


class Method(Protocol):
    """Learns from one interaction after the other; what it has learnt is safe on disk.

    A method begins where its run's store says that it stands.

    Attributes:
        PHYSICS: Name of the back-end that it works with where nobody asks for another.
        RULE: Name of the exploration rule that chooses its motor programs by default.
    """

    PHYSICS: ClassVar[str]
    RULE: ClassVar[str]

    @staticmethod
    def check(config: RunConfig) -> None:
        """Refuses what the method has no use for.

        Raises:
            EstimatorError: The config asks for such a thing.
        """

    @classmethod
    def open(
        cls, store: RunStore, computers: Computers, listener: Listener, stack: ExitStack
    ) -> tuple[Method, ArrayMarginPhysics]:
        """Makes the method of a run.

        Args:
            store: The run's memory; opened for writing.
            computers: Do the work.
            listener: Hears what happens.
            stack: Closes in the end what is opened here.

        Returns:
            The method, and the back-end with which motor programs are chosen.
        """

    def work(self, number: int) -> float:
        """How much there is to do after an interaction, in any unit."""

    def done(self, number: int) -> float:
        """How much of that is on disk already."""

    def learn(self, number: int, observations: Sequence[Observation]) -> None:
        """Learns from an interaction; what was learnt before a crash is not learnt again.

        Args:
            number: Of the interaction, from 0.
            observations: Of all interactions so far.
        """

    def posterior(self) -> FittedPosterior:
        """What is known of the body by now; random bodies before the first interaction."""

    def is_sure(self, number: int) -> bool:
        """Whether after this interaction no further one is worth its while, by the settings."""

    def finish(self, observations: Sequence[Observation]) -> None:
        """Asks the reference back-end for the last word, unless it was asked."""
