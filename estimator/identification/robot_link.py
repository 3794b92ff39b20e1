"""Where readings come from, behind one interface: a robot daemon, a table, a recorded run.

======================= ===================================================================
``tcp://HOST:PORT``     a robot daemon, over the wire
``file:READINGS.csv``   readings that a person wrote down, with ``robot.json`` beside them
``replay:DIR``          the readings of a recorded run
======================= ===================================================================

``readings.csv`` is described in ``estimator.readings.readings_csv``. ``robot.json`` says what a
robot would say about itself; every run writes one, and by hand three keys are enough::

    {"base_size": [0.14, 0.14, 0.085], "base_mass": 0.6, "clearance_upper": 0.2}

in m and kg; ``clearance_upper`` is the largest clearance that could have been measured. A sensor
without a column was not read, so the robot counts as lacking it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, Protocol

from estimator.errors import EstimatorError, InteractionError, ReadingsError, RunDirectoryError
from estimator.readings.modalities import MODALITIES, ROUNDING
from estimator.readings.observation import Observation, Program, by_joint_name, same_program
from estimator.readings.plausibility import AnswerChecks, implausible_body, impossible_reading
from estimator.readings.readings_csv import ANGLE, Table, read
from estimator.storage.records import Ticket
from estimator.storage.store import RunStore
from protocol.errors import LocalProtocolError, RobotError, RobotRestartedError
from protocol.transport.client import RobotClient
from protocol.wire import messages
from protocol.wire.capabilities import Capabilities

OnProgress = Callable[[str, float], None]
"""Called with the phase of a motion and the share of it that is done, 0 to 1."""


class RobotLink(Protocol):
    """A connection to a robot, or a record of its readings.

    Attributes:
        capabilities: Capabilities of the robot.
        client_id: Client id of requests to the robot.
        recorded: The motor programs of a record, the only ones it can perform; ``None``: a robot,
            which performs any.
    """

    capabilities: Capabilities
    client_id: str
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
        self._programs = programs
        self._observations = observations

    def ticket(self) -> Ticket | None:
        """Returns ``None``: a record needs no ticket."""
        return None

    def perform(
        self, number: int, program: Program, ticket: Ticket | None, on_progress: OnProgress
    ) -> Observation:
        """Returns the observation that was recorded under this number.

        Raises:
            InteractionError: The record holds none, or that of another motor program.
        """
        programs = self._programs
        if number >= len(programs) or not same_program(program, programs[number]):
            raise InteractionError(
                f"interaction {number + 1}: the record does not hold the motor program that the "
                "run had planned: go on with the robot, or start a new run with the record."
            )
        return self._observations[number]

    def outcome(
        self, program: Program, ticket: Ticket, on_progress: OnProgress
    ) -> Observation | None:
        """Returns ``None``: no request to a record can be pending."""
        return None

    def close(self) -> None:
        """Does nothing: a record holds no robot."""


def open_replay(directory: Path) -> Record:
    """Opens the interactions of a recorded run as a robot link.

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


ROBOT_FILE: Final = "robot.json"
_SLEW: Final = math.radians(60.0)  # the paper's servos


def open_by_hand(path: Path, driven: Callable[[Capabilities], Collection[int]]) -> Record:
    """Opens a hand-written table of readings as a robot link.

    Args:
        path: The table.
        driven: Returns the motors whose angles every row must state; the others stand at 0 where
            they have no column.

    Raises:
        ReadingsError: A file cannot be read or is wrong; the message names it and the reason.
    """
    table = read(path)
    robot = path.with_name(ROBOT_FILE)
    capabilities = _capabilities(robot, path, table)
    names = [joint.name for joint in capabilities.joints]
    unknown = [name for name in table.joints if name not in names]
    if unknown:
        raise ReadingsError(
            f"{path}: the robot has no joint {', '.join(unknown)}; {robot} names "
            f"{', '.join(names)}."
        )
    missing = [names[motor] for motor in driven(capabilities) if motor < len(names)]
    missing = [name for name in missing if name not in table.joints]
    if missing:
        raise ReadingsError(
            f"{path}: the problem drives {', '.join(missing)}, so write the columns "
            f"{', '.join(ANGLE + name for name in missing)}."
        )
    observations = tuple(_as_felt(row, table.joints, capabilities) for row in table.observations)
    for number, row in enumerate(observations, 1):
        wrong = impossible_reading(row, capabilities)
        if wrong is not None:
            raise ReadingsError(f"{path}, row {number}: says {wrong}: correct that, or {robot}.")
    return Record(capabilities, tuple(row.angles for row in observations), observations)


def _capabilities(robot: Path, path: Path, table: Table) -> Capabilities:
    advice = 'write at least {"base_size": [x, y, z], "base_mass": m} there, in m and kg'
    try:
        description = json.loads(robot.read_text("utf-8"))
    except OSError as error:
        raise ReadingsError(
            f"{path} says nothing about the main body, and {robot} cannot be read "
            f"({error.strerror}): {advice}."
        ) from error
    except (ValueError, RecursionError) as error:
        raise ReadingsError(f"{robot} is no JSON file: {error}.") from error
    if not isinstance(description, dict):
        raise ReadingsError(f"{robot} must hold an object: {advice}.")
    missing = [key for key in ("base_size", "base_mass") if key not in description]
    if missing:
        raise ReadingsError(f"{robot} lacks {', '.join(missing)}: {advice}.")
    try:
        said = Capabilities.from_map({**_assumed(description, table), **description})
    except LocalProtocolError as error:
        raise ReadingsError(f"{robot}: {error}.") from error
    for sensor in said.sensors:
        count, modality = table.counts[sensor.modality], MODALITIES[sensor.modality]
        if modality.on_parts and count not in (0, sensor.count):
            raise ReadingsError(
                f"{path} has {count} {modality.name} columns, but the robot has {sensor.count} "
                f"such sensors by {robot}: write a column for each, empty where nothing was read, "
                "or none."
            )
    return replace(said, sensors=tuple(one for one in said.sensors if table.counts[one.modality]))


def _assumed(description: dict[str, Any], table: Table) -> dict[str, Any]:
    """Returns capabilities that the table implies, and defaults for those that do not matter."""
    sensors = []
    for name, modality in MODALITIES.items():
        sensor = {"modality": name, "unit": modality.unit, "count": table.counts[name]}
        if modality.upper is not None:
            sensor["upper"] = description.get(f"{name}_upper", modality.upper)
        sensors.append(sensor)
    return {
        "robot": "by hand",
        "software": "none",
        "config_hash": "none",
        "joints": [
            {"name": name, "lower": -math.pi, "upper": math.pi, "speed": _SLEW, "resolution": 0.0}
            for name in table.joints
        ],
        "sensors": [{"noise": 0.0, "rate": 1.0, **item} for item in sensors if item["count"]],
        "telemetry": "none",
        "telemetry_rate": 1.0,
    }


def _as_felt(row: Observation, columns: tuple[str, ...], robot: Capabilities) -> Observation:
    """A row as this robot would have reported it.

    Where a servo measures its angle the table has that, and not the angle commanded: it may lie
    beyond the joint's ends, and the nearest one within them is taken to be commanded.
    """
    angles = dict(zip(columns, row.angles, strict=True))
    commanded: list[float] = []
    measured: list[float | None] = []
    for joint in robot.joints:
        angle = angles.get(joint.name, 0.0)
        measures = joint.measured_noise is not None
        commanded.append(min(max(angle, joint.lower), joint.upper) if measures else angle)
        measured.append(angle if measures else None)
    sensor = robot.sensor("clearance")
    upper = None if sensor is None else sensor.upper
    reaches_upper = (
        row.clearance is not None and upper is not None and row.clearance >= upper - ROUNDING
    )
    return row.model_copy(
        update={
            "angles": tuple(commanded),
            "measured": tuple(measured),
            "clearance_saturated": reaches_upper,
        }
    )


PATIENCE: Final = 10.0
"""Seconds without a word from the robot after which a run stops."""

_NEVER_DONE: Final = ("not_controller", "expired")
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
        self.client_id = client_id
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


def is_record(uri: str) -> bool:
    """Whether a URI names a record, which cannot move, and not a robot."""
    return uri.startswith(("file:", "replay:"))


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
        EstimatorError: The URI is of no known kind, the record cannot be read, or the robot
            describes a body that no robot can have.
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
    wrong = implausible_body(link.capabilities)
    if wrong is not None:
        link.close()
        raise EstimatorError(f"The robot at {uri} cannot be: {wrong}. Write metres and kilograms.")
    return link
