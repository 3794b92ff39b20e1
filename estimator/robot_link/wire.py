"""A robot daemon as a robot link."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from estimator.readings.observation import Observation, Program, by_joint_name
from estimator.readings.plausibility import AnswerChecks
from estimator.robot_link.base import OnProgress
from estimator.storage.records import Ticket
from protocol.errors import RobotError, RobotRestartedError
from protocol.transport.client import RobotClient
from protocol.wire import messages
from protocol.wire.capabilities import Capabilities

PATIENCE: Final = 10.0
"""Seconds without a word from the robot after which a run stops."""

_NEVER_DONE: Final = ("not_controller", "expired")
"""Errors that say that a request of an earlier connection did not move the robot."""


class WireLink:
    """A session with a robot daemon.

    Args:
        uri: ``tcp://host:port``.
        client_id: The client id of requests, the same for the whole run.
        first_id: The first request id of this connection; above all that were used before.
        keys: The key directory, where the robot asks for keys.

    Raises:
        BodyschemaError: Nothing answers there, or not in a version of the protocol that we know.
    """

    def __init__(self, uri: str, *, client_id: str, first_id: int, keys: Path | None = None):
        self._uri = uri
        self._client = RobotClient(
            uri,
            client_id=client_id,
            next_id=first_id,
            timeout=PATIENCE,
            software="estimator",
            keys=keys,
        )
        self.client_id = client_id
        self.capabilities: Capabilities = self._client.capabilities
        self.recorded: tuple[Program, ...] | None = None
        self._checks = AnswerChecks(self.capabilities)

    def ticket(self) -> Ticket | None:
        """Makes sure of control over the robot, then reserves an id.

        If the daemon restarted between two requests nothing is lost, so a new session is opened
        without an error.
        """
        try:
            self._client.acquire()
        except RobotRestartedError:
            self._client.hello()
            self._checks = AnswerChecks(self.capabilities)  # with the daemon its clock began anew
            self._client.acquire()
        return Ticket(request_id=self._client.reserve_id(), session=self._client.session)

    def perform(
        self, number: int, program: Program, ticket: Ticket | None, on_progress: OnProgress
    ) -> Observation:
        """Performs a motor program under the id that was reserved for it."""
        assert ticket is not None
        reply = self._client.perform(
            by_joint_name(program, self.capabilities),
            request_id=ticket.request_id,
            on_progress=lambda progress: on_progress(progress.phase, progress.fraction),
        )
        return self._observation(program, reply)

    def outcome(
        self, program: Program, ticket: Ticket, on_progress: OnProgress
    ) -> Observation | None:
        """Asks again under the same id, which moves the robot at most once.

        Control is not asked for first: a request that never arrived is then refused, unless this
        run still has control, and then it is carried out as it was meant.
        """
        if ticket.session != self._client.session:
            raise RobotRestartedError(f"The robot at {self._uri} restarted since it was asked.")
        try:
            return self.perform(0, program, ticket, on_progress)
        except RobotError as error:
            if error.code in _NEVER_DONE:
                return None
            raise

    def close(self) -> None:
        """Releases the robot; a motion that is still under way ends where it is."""
        self._client.close()

    def _observation(self, program: Program, reply: messages.ObservationReply) -> Observation:
        names = [joint.name for joint in self.capabilities.joints]
        if set(reply.angles) != set(names):
            raise self._disbelief(
                f"angles of {', '.join(reply.angles)}, but its joints are {', '.join(names)}"
            )
        unknown = [name for name in reply.saturated_joints if name not in names]
        if unknown:
            raise self._disbelief(
                f"{', '.join(unknown)} at an end, but its joints are {', '.join(names)}"
            )
        observation = Observation.from_wire(reply, self.capabilities)
        wrong = self._checks.wrong(program, observation)
        if wrong is not None:
            raise self._disbelief(wrong)
        return observation

    def _disbelief(self, what: str) -> RobotError:
        """Returns the error of an answer that cannot be true, of which nothing is used."""
        return RobotError(
            "fault",
            f"The robot at {self._uri} reported {what}.",
            advice="Check its sensors, servos and their calibration, then try again.",
            retryable=True,
        )
