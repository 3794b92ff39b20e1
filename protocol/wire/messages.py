"""The messages of the protocol, frozen and validated: an illegal message cannot exist.

A message becomes a map with ``to_map`` and is read back with ``parse_request`` or
``parse_reply``. Unknown fields are ignored, so that later versions may add some; ``None`` means
absent. ``SPEC.md`` describes each message in words.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Any, ClassVar, Final, cast

from protocol.errors import (
    LocalProtocolError,
    RemoteProtocolError,
    RobotError,
    with_address,
)
from protocol.wire import field_checks
from protocol.wire.capabilities import Capabilities
from protocol.wire.codec import request_id_of
from protocol.wire.declaration import Message, checked, checked_optional, nested

PROTOCOL_VERSION: Final = 1
PHASES: Final = ("homing", "moving", "settling", "sampling")


class State(StrEnum):
    """What the robot is doing."""

    IDLE = "idle"  # servos hold; nothing was asked yet
    MOVING = "moving"  # joints slew
    SETTLING = "settling"  # targets reached; waiting for rest, then sampling
    HOLDING = "holding"  # holds the pose of the last request
    RELAXED = "relaxed"  # servos limp
    STOPPED = "stopped"  # stop latched; frozen at the last commanded counts
    FAULT = "fault"  # a device failed; frozen until cleared


_natural = partial(field_checks.integer, least=0)
_positive = partial(field_checks.integer, least=1)
_name = partial(field_checks.text, longest=field_checks.MAX_NAME)
_state = partial(field_checks.one_of, choices=[state.value for state in State])
_angles = partial(field_checks.mapping, check=field_checks.number)


# --- requests -------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Request(Message):
    """What a client asks. ``client`` is the UUID it chose; ``id`` correlates the answers.

    Attributes:
        NEEDS_CONTROL: Whether only the client that controls the robot may send it.
        FOR_VIEWERS: Whether a viewer's key is enough.
    """

    NEEDS_CONTROL: ClassVar[bool] = False
    FOR_VIEWERS: ClassVar[bool] = False
    id: int = checked(_natural)
    client: str = checked(_name)


@dataclass(frozen=True, kw_only=True)
class Hello(Request):
    """Opens or re-opens a session; answered by ``Welcome``."""

    TYPE: ClassVar[str] = "hello"
    FOR_VIEWERS: ClassVar[bool] = True
    versions: tuple[int, ...] = checked(partial(field_checks.items, check=_positive))
    software: str | None = checked_optional(_name)


@dataclass(frozen=True, kw_only=True)
class SessionRequest(Request):
    """A request inside the session that ``Welcome`` named."""

    session: str = checked(_name)


@dataclass(frozen=True, kw_only=True)
class RobotRequest(Request):
    """A request that reaches the robot; the server deals with every other by itself.

    Attributes:
        ACCEPTED: Whether the client is told when the robot has taken it on.
    """

    ACCEPTED: ClassVar[bool] = False


@dataclass(frozen=True, kw_only=True)
class Heartbeat(SessionRequest):
    """Sign of life, answered by ``Status``; never remembered, so any id will do."""

    TYPE: ClassVar[str] = "heartbeat"
    FOR_VIEWERS: ClassVar[bool] = True


@dataclass(frozen=True, kw_only=True)
class Acquire(SessionRequest):
    """Asks for control of the robot."""

    TYPE: ClassVar[str] = "acquire"


@dataclass(frozen=True, kw_only=True)
class Release(SessionRequest):
    """Gives control back."""

    TYPE: ClassVar[str] = "release"
    NEEDS_CONTROL: ClassVar[bool] = True


@dataclass(frozen=True, kw_only=True)
class Perform(RobotRequest, SessionRequest):
    """One interaction: return to zero, slew to the targets (rad), settle, read."""

    TYPE: ClassVar[str] = "perform"
    NEEDS_CONTROL: ClassVar[bool] = True
    ACCEPTED: ClassVar[bool] = True
    targets: Mapping[str, float] = checked(_angles)


@dataclass(frozen=True, kw_only=True)
class Read(RobotRequest, SessionRequest):
    """Reads the sensors in the present pose, without moving."""

    TYPE: ClassVar[str] = "read"
    FOR_VIEWERS: ClassVar[bool] = True
    ACCEPTED: ClassVar[bool] = True


@dataclass(frozen=True, kw_only=True)
class Hold(RobotRequest, SessionRequest):
    """Ends a motion and holds the present pose."""

    TYPE: ClassVar[str] = "hold"
    NEEDS_CONTROL: ClassVar[bool] = True


@dataclass(frozen=True, kw_only=True)
class Relax(RobotRequest, SessionRequest):
    """Lets the servos go limp: the only request that does."""

    TYPE: ClassVar[str] = "relax"
    NEEDS_CONTROL: ClassVar[bool] = True


@dataclass(frozen=True, kw_only=True)
class Stop(RobotRequest):
    """Freezes the robot now, for anybody, in any session or none; latches until ``Clear``."""

    TYPE: ClassVar[str] = "stop"
    FOR_VIEWERS: ClassVar[bool] = True
    session: str | None = checked_optional(_name)


@dataclass(frozen=True, kw_only=True)
class Clear(RobotRequest, SessionRequest):
    """Ends a latched stop or a fault."""

    TYPE: ClassVar[str] = "clear"
    NEEDS_CONTROL: ClassVar[bool] = True


# --- replies --------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Reply(Message):
    """What the robot answers; ``id`` is the request's."""

    id: int = checked(_natural)


@dataclass(frozen=True, kw_only=True)
class Welcome(Reply):
    """Answer to ``Hello``."""

    TYPE: ClassVar[str] = "welcome"
    version: int = checked(_positive)
    session: str = checked(_name)
    robot_time: float = checked(field_checks.number)
    capabilities: Capabilities = checked(nested(Capabilities))
    last_id: int | None = checked_optional(_natural)


@dataclass(frozen=True, kw_only=True)
class Ok(Reply):
    """Done; ``state`` is the robot's state after it."""

    TYPE: ClassVar[str] = "ok"
    state: str = checked(_state)


@dataclass(frozen=True, kw_only=True)
class Status(Reply):
    """Answer to ``Heartbeat``."""

    TYPE: ClassVar[str] = "status"
    state: str = checked(_state)
    robot_time: float = checked(field_checks.number)
    sequence: int = checked(_natural)
    controller: str | None = checked_optional(_name)
    reason: str | None = checked_optional(field_checks.text)


@dataclass(frozen=True, kw_only=True)
class Accepted(Reply):
    """The robot has taken on a ``Perform`` or a ``Read``; more follows."""

    TYPE: ClassVar[str] = "accepted"


@dataclass(frozen=True, kw_only=True)
class Progress(Reply):
    """How far a motion is: its phase and the share of it that is done, 0 to 1."""

    TYPE: ClassVar[str] = "progress"
    phase: str = checked(partial(field_checks.one_of, choices=PHASES))
    fraction: float = checked(partial(field_checks.number, least=0.0, most=1.0))
    robot_time: float = checked(field_checks.number)


@dataclass(frozen=True, kw_only=True)
class ObservationReply(Reply):
    """What the robot observed, after a ``Perform`` or a ``Read``.

    Attributes:
        sequence: Number that grows by at least one per observation within one daemon start.
        robot_time: Robot clock at the end of sampling, s.
        monotonic: The robot computer's monotonic clock at the same moment, s.
        angles: The angles actually commanded after quantisation and clamping, by joint, rad.
        saturated_joints: Joints that stand at the end of their reachable range.
        measured: Measured angles of the joints that have a sensor for it, rad; ``None``: none has.
        off_target: Measured joints that came to rest away from the angle commanded, each with a
            description for people; ``None`` where none does.
        touch: One bit per touch sensor, or ``None`` without touch sensors.
        tilt: Left/right and forward/back tilt, rad (left side up and nose up are positive).
        zero_tilt: The same at rest in the zero pose from which a ``Perform`` moved on; ``None``
            after a ``Read``, and where the robot did not come to rest there.
        clearance: Belly to ground along the belly's normal, m.
        clearance_saturated: Whether the ground lay beyond the sensor's range.
        settled: Whether the readings came to rest before they were averaged.
        settle_time: Time waited for rest, s: since the last command of a ``Perform``, or since a
            ``Read`` began.
        samples: Number of samples in the average.
    """

    TYPE: ClassVar[str] = "observation"
    sequence: int = checked(_positive)
    robot_time: float = checked(field_checks.number)
    monotonic: float = checked(field_checks.number)
    angles: Mapping[str, float] = checked(_angles)
    saturated_joints: tuple[str, ...] = checked(partial(field_checks.items, check=_name))
    measured: Mapping[str, float] | None = checked_optional(_angles)
    off_target: Mapping[str, str] | None = checked_optional(
        partial(field_checks.mapping, check=_name)
    )
    touch: tuple[bool, ...] | None = checked_optional(
        partial(field_checks.items, check=field_checks.boolean)
    )
    tilt: tuple[float, ...] | None = checked_optional(
        partial(field_checks.items, check=field_checks.number, count=2)
    )
    zero_tilt: tuple[float, ...] | None = checked_optional(
        partial(field_checks.items, check=field_checks.number, count=2)
    )
    clearance: float | None = checked_optional(field_checks.number)
    clearance_saturated: bool = checked(field_checks.boolean)
    settled: bool = checked(field_checks.boolean)
    settle_time: float = checked(partial(field_checks.number, least=0.0))
    samples: int = checked(_positive)


@dataclass(frozen=True, kw_only=True)
class ErrorReply(Message):
    """A typed error; ``id`` is absent where the frame's own could not be read."""

    TYPE: ClassVar[str] = "error"
    id: int | None = checked_optional(_natural)
    code: str = checked(_name)  # a later version of the protocol may send others than ours
    message: str = checked(field_checks.text)
    advice: str = checked(field_checks.text)
    retryable: bool = checked(field_checks.boolean)

    @classmethod
    def of(cls, error: RobotError, *, request_id: int | None) -> ErrorReply:
        """The reply that carries an error."""
        return cls(
            id=request_id,
            code=error.code,
            message=error.message[: field_checks.MAX_TEXT],
            advice=error.advice[: field_checks.MAX_TEXT],
            retryable=error.retryable,
        )

    def to_error(self, robot: str) -> RobotError:
        """The error that the reply carries; a command in its advice names the robot's address."""
        advice = with_address(self.advice, robot)
        return RobotError(self.code, self.message, advice=advice, retryable=self.retryable)


@dataclass(frozen=True, kw_only=True)
class Telemetry(Message):
    """Published on topic ``telemetry`` at the rate that ``Welcome`` names."""

    TYPE: ClassVar[str] = "telemetry"
    robot: str = checked(_name)
    state: str = checked(_state)
    robot_time: float = checked(field_checks.number)
    sequence: int = checked(_natural)
    angles: Mapping[str, float] = checked(_angles)
    controller: str | None = checked_optional(_name)
    reason: str | None = checked_optional(field_checks.text)


REQUESTS: Final = {
    kind.TYPE: kind
    for kind in (Hello, Heartbeat, Acquire, Release, Perform, Read, Hold, Relax, Stop, Clear)
}
REPLIES: Final = {
    kind.TYPE: kind
    for kind in (Welcome, Ok, Status, Accepted, Progress, ObservationReply, ErrorReply)
}
FINAL_REPLIES: Final = (Welcome, Ok, Status, ObservationReply, ErrorReply)


def parse_request(values: Mapping[str, Any]) -> Request:
    """Builds a request from a decoded map.

    Raises:
        RemoteProtocolError: The map is no valid request; the message names the field.
    """
    return cast(Request, _parse(values, REQUESTS))


def parse_reply(values: Mapping[str, Any]) -> Reply | ErrorReply:
    """Builds a reply from a decoded map.

    Raises:
        RemoteProtocolError: The map is no valid reply; the message names the field.
    """
    return cast("Reply | ErrorReply", _parse(values, REPLIES))


def parse_telemetry(values: Mapping[str, Any]) -> Telemetry:
    """Builds a telemetry message from a decoded map.

    Raises:
        RemoteProtocolError: The map is no valid telemetry message.
    """
    return cast(Telemetry, _parse(values, {Telemetry.TYPE: Telemetry}))


def _parse(values: Mapping[str, Any], kinds: Mapping[str, type[Any]]) -> Message:
    name = values.get("type")
    kind = kinds.get(name) if isinstance(name, str) else None
    if kind is None:
        code = "unknown_type" if isinstance(name, str) else "malformed"
        sentence = f"'type' must be one of {', '.join(kinds)}, not {name!r:.60}"
        raise RemoteProtocolError(sentence, code=code, request_id=request_id_of(values))
    try:
        return cast(Message, kind.from_map(values))
    except LocalProtocolError as error:
        raise RemoteProtocolError(f"{name}: {error}", request_id=request_id_of(values)) from None
