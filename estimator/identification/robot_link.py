"""Where readings come from, behind one interface: a robot daemon, a table, a recorded run.

======================= ===================================================================
``tcp://HOST:PORT``     a robot daemon, over the wire
``file:READINGS.csv``   readings that a person wrote down, with ``robot.json`` beside them
``replay:DIR``          the readings of a recorded run
======================= ===================================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Final, Protocol

from estimator.errors import EstimatorError, InteractionError, ReadingsError
from estimator.identification.record_link import open_by_hand, open_replay
from estimator.readings.observation import Observation, Program, by_joint_name
from estimator.readings.plausibility import AnswerChecks, implausible_body
from estimator.storage.records import Ticket
from protocol.errors import RobotError, RobotRestartedError
from protocol.transport.client import RobotClient
from protocol.wire import messages
from protocol.wire.capabilities import Capabilities

OnProgress = Callable[[str, float], None]
"""Called with the phase of a motion and the share of it that is done, 0 to 1."""


class RobotLink(Protocol):
    """A connection to a robot, or a record of its readings.

    Attributes:
        capabilities: Capabilities of the robot.
        recorded: The motor programs of a record, the only ones it can perform; ``None``: a robot,
            which performs any.
    """

    capabilities: Capabilities
    recorded: tuple[Program, ...] | None

    def ticket(self) -> Ticket | None:
        """Ticket of the next request, to be committed before that is sent; ``None``: not needed.

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
            ticket: Ticket that the method ``ticket`` returned.
            on_progress: Called with the progress of the motion.

        Raises:
            RobotError: The robot refused, broke off or reported what cannot be; a fresh ticket is
                needed to try again.
            RobotRestartedError: The daemon restarted, and the outcome of the motion is unknown.
            RobotUnreachableError: Nothing answers any more.
            InteractionError: A record does not hold the program under this number.
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


PATIENCE: Final = 10.0
"""Seconds without a word from the robot after which a run stops."""

_AT_REST: Final = math.radians(3.0)  # servos that were told 0° may be measured so far off

_NEVER_DONE: Final = ("not_controller", "out_of_order")
"""Error codes that say that a request of an earlier connection did not move the robot."""


class WireLink:
    """A session with a robot daemon.

    Args:
        uri: ``tcp://host:port``.
        client_id: The client id of requests, the same for the whole run.
        first_id: First request id of this connection; above all that were used before.
        keys: Key directory, where the robot asks for keys.

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
        self.capabilities: Capabilities = self._client.capabilities
        self.recorded: tuple[Program, ...] | None = None
        self._checks = AnswerChecks(self.capabilities)

    def ticket(self) -> Ticket | None:
        """Makes sure of control over the robot, then reserves an id.

        If the daemon restarted between two requests nothing is lost, so a new session is opened
        without an error.

        Raises:
            InteractionError: Another robot answers there since.
        """
        try:
            self._client.acquire()
        except RobotRestartedError:
            self._client.hello()
            self._checks = AnswerChecks(self.capabilities)  # with the daemon its clock began anew
            self._client.acquire()
        if lasting_properties(self._client.capabilities) != lasting_properties(self.capabilities):
            raise InteractionError(
                f"The robot at {self._uri} restarted, and has other joints, sensors or another "
                "main body now: start a new run with it."
            )
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
            raise self._rejected(
                f"angles of {', '.join(reply.angles)}, but its joints are {', '.join(names)}"
            )
        unknown = [name for name in reply.saturated_joints if name not in names]
        if unknown:
            raise self._rejected(
                f"{', '.join(unknown)} at an end, but its joints are {', '.join(names)}"
            )
        observation = Observation.from_wire(reply, self.capabilities)
        wrong = self._checks.wrong(program, observation)
        if wrong is not None:
            raise self._rejected(wrong)
        return observation

    def _rejected(self, what: str) -> RobotError:
        """Returns the error of an answer that cannot be true, of which nothing is used."""
        return RobotError(
            "fault",
            f"The robot at {self._uri} reported {what}.",
            advice="Check its sensors, servos and their calibration, then try again.",
            retryable=True,
        )


def lasting_properties(capabilities: Capabilities) -> tuple[object, ...]:
    """Properties that must not change during a run; noise, software and addresses may."""
    return (
        [joint.name for joint in capabilities.joints],
        [(sensor.modality, sensor.count, sensor.upper) for sensor in capabilities.sensors],
        capabilities.base_size,
        capabilities.base_radius,
        capabilities.base_mass,
    )


def open_robot(
    uri: str,
    *,
    driven: Callable[[Capabilities], Collection[int]],
    client_id: str,
    first_id: int,
    keys: Path | None = None,
) -> RobotLink:
    """Connects to a robot, or opens a record of one.

    Args:
        uri: URI of the robot or the record; see the module's table.
        driven: Returns the motors of a robot that the problem drives.
        client_id: Client id of requests to the robot.
        first_id: First request id that this connection may use.
        keys: Key directory, where the robot asks for keys.

    Raises:
        EstimatorError: The URI is of no known kind, the record cannot be read or has moved what the
            problem does not drive, or the robot describes a body that no robot can have.
        BodyschemaError: The robot cannot be reached.
    """
    scheme, _, rest = uri.partition(":")
    link: RobotLink
    if scheme == "file" and rest:
        link = open_by_hand(Path(rest), driven)
    elif scheme == "replay" and rest:
        link = open_replay(Path(rest))
    elif scheme in ("tcp", "ipc") and rest.startswith("//"):
        link = WireLink(uri, client_id=client_id, first_id=first_id, keys=keys)
    else:
        raise EstimatorError(
            f"{uri!r} names no robot: write tcp://HOST:PORT, file:READINGS.csv or replay:DIR."
        )
    _check_undriven(uri, link, driven)
    wrong = implausible_body(link.capabilities)
    if wrong is not None:
        link.close()
        raise EstimatorError(f"The robot at {uri} cannot be: {wrong}. Write metres and kilograms.")
    return link


def _check_undriven(
    uri: str, link: RobotLink, driven: Callable[[Capabilities], Collection[int]]
) -> None:
    """Refuses a record in which a joint moved that models have at 0."""
    for number, program in enumerate(link.recorded or (), 1):
        driven_motors = driven(link.capabilities)
        for motor, joint in enumerate(link.capabilities.joints):
            if motor not in driven_motors and abs(program[motor]) > _AT_REST:
                raise ReadingsError(
                    f"{uri}, interaction {number}: {joint.name} stands at "
                    f"{math.degrees(program[motor]):.0f}°, and the problem does not drive it: name "
                    "it in `driven`, or take readings with it at 0°."
                )
