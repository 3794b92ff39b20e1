"""What a method of modelling is: it learns from interactions, and says what it believes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from estimator.posterior.fitted import FittedPosterior
from estimator.readings.observation import Observation


class Method(Protocol):
    """Learns from one interaction after the other; what it has learnt is safe on disk.

    A method begins where its run's store says that it stands.
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
