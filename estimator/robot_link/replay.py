"""A recorded run as a robot, which repeats the observations it made then."""

from __future__ import annotations

from pathlib import Path

from estimator.errors import RunDirectoryError
from estimator.readings.observation import Observation, Program
from estimator.robot_link.base import OnProgress
from estimator.storage.records import Ticket
from estimator.storage.store import RunStore
from protocol.wire.capabilities import Capabilities


class Record:
    """Observations made earlier, as a robot link."""

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
        """Returns ``None``: a record needs no ticket."""
        return None

    def perform(
        self, number: int, program: Program, ticket: Ticket | None, on_progress: OnProgress
    ) -> Observation:
        """Returns the observation that was recorded under this number."""
        return self._observations[number]

    def outcome(
        self, program: Program, ticket: Ticket, on_progress: OnProgress
    ) -> Observation | None:
        """Returns ``None``: no request to a record can be pending."""
        return None

    def close(self) -> None:
        """Does nothing: a record holds no robot."""


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
