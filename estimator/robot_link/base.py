"""The interface to a robot, or to readings recorded earlier."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from estimator.readings.observation import Observation, Program
from estimator.storage.records import Ticket
from protocol.wire.capabilities import Capabilities

OnProgress = Callable[[str, float], None]
"""Called with the phase of a motion and the share of it that is done, 0 to 1."""


class RobotLink(Protocol):
    """A connection to a robot, or a record of its readings.

    Attributes:
        capabilities: What the robot is.
        client_id: The name under which requests reach it.
        recorded: The motor programs of a record, the only ones it can perform; ``None``: a robot,
            which performs any.
    """

    capabilities: Capabilities
    client_id: str
    recorded: tuple[Program, ...] | None

    def ticket(self) -> Ticket | None:
        """The name of the next request, to be committed before it is sent; ``None``: none needed.

        Raises:
            BodyschemaError: The robot cannot be had, for example because another holds it.
        """

    def perform(
        self, number: int, program: Program, ticket: Ticket | None, on_progress: OnProgress
    ) -> Observation:
        """Performs a motor program, under a fresh ticket.

        Args:
            number: Number of the interaction, by which a record finds its row.
            program: Targets, rad, one per joint in motor order.
            ticket: From ``ticket``.
            on_progress: Called with the progress of the motion.

        Raises:
            RobotError: The robot refused, broke off or reported what cannot be; a fresh ticket is
                needed to try again.
            RobotRestartedError: The daemon restarted, and the outcome of the motion is unknown.
            RobotUnreachableError: Nothing answers any more.
        """

    def outcome(
        self, program: Program, ticket: Ticket, on_progress: OnProgress
    ) -> Observation | None:
        """Asks for the result of a request of an earlier connection; waits if it is under way.

        Returns:
            The observation, or ``None`` when the request was certainly not carried out.

        Raises:
            RobotRestartedError: The daemon restarted since, so the outcome is unknown.
            RobotError: The request ended with this error.
        """

    def close(self) -> None:
        """Releases the robot and closes the connection."""
