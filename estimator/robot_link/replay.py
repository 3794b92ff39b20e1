"""A recorded run as a robot: it can perform what it performed then, and feels the same again."""

from __future__ import annotations

from pathlib import Path

from estimator.errors import RunDirectoryError
from estimator.readings.observation import Observation, Program
from estimator.robot_link.base import OnProgress
from estimator.storage.records import Ticket
from estimator.storage.store import RunStore
from protocol.wire.capabilities import Capabilities


class Record:
    """Observations made before, as a robot link. There is nothing to ask, so nothing to lose."""

    client_id = "record"

    def __init__(
        self,
        capabilities: Capabilities,
        programs: tuple[Program, ...],
        observations: tuple[Observation, ...],
    ):
        self.capabilities = capabilities
        self.recorded: tuple[Program, ...] | None = programs
        self._observations = observations

    def ticket(self) -> Ticket | None:
        """A record needs none."""
        return None

    def perform(
        self, number: int, program: Program, ticket: Ticket | None, on_progress: OnProgress
    ) -> Observation:
        """The observation that was recorded under this number."""
        return self._observations[number]

    def outcome(
        self, program: Program, ticket: Ticket, on_progress: OnProgress
    ) -> Observation | None:
        """A record was never asked for anything."""
        return None

    def close(self) -> None:
        """Nothing to give back."""


def open_replay(directory: Path) -> Record:
    """The interactions of a recorded run.

    Raises:
        RunDirectoryError: There is no run, or nothing was observed in it.
    """
    with RunStore.open(directory, to_write=False) as store:
        performed = [
            (item.program, item.observation)
            for item in store.interactions()
            if item.observation is not None
        ]
        if not performed:
            raise RunDirectoryError(f"{directory} holds no observation that could be replayed.")
        programs, observations = zip(*performed, strict=True)
        return Record(store.capabilities, programs, observations)
