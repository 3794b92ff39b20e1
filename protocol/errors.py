"""Everything that can go wrong between a robot and its controller.

The tree::

    BodyschemaError
    ├── ProtocolError
    │   ├── LocalProtocolError (ValueError)   an illegal message was to be built here
    │   └── RemoteProtocolError               the peer sent an illegal frame
    ├── RobotError                            the robot answered a request with an error
    ├── EndpointError (ValueError)            an address that cannot be bound or connected to
    ├── KeysError (ValueError)                a key directory that cannot be used
    ├── RobotUnreachableError (TimeoutError)  nothing answered in time
    └── RobotRestartedError                   the daemon restarted; a move's fate is unknown

``ERROR_CODES`` is the table of what a robot may answer; ``SPEC.md`` prints the same table and
the tests hold the two together.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

CLEAR: Final = "python -m protocol URI clear"
"""How a person clears a robot that is stopped, or that failed."""

HOLD: Final = "python -m protocol URI hold"
"""How a person makes a limp robot stiff again."""

STATUS: Final = "python -m protocol URI status"
"""How a person asks what a robot does, and who controls it."""


def with_address(advice: str, robot: str) -> str:
    """``advice``, whose commands name the address ``robot`` instead of ``URI``."""
    for command in (CLEAR, HOLD, STATUS):
        advice = advice.replace(command, command.replace("URI", robot))
    return advice


class BodyschemaError(Exception):
    """Base of every error that this project raises on purpose."""


class ProtocolError(BodyschemaError):
    """A rule of the protocol was broken."""


class LocalProtocolError(ProtocolError, ValueError):
    """An illegal message was to be built here (NaN target, negative id, …)."""


class RemoteProtocolError(ProtocolError):
    """The peer sent a frame that is no valid message.

    Attributes:
        code: The error code with which to answer, a key of ``ERROR_CODES``.
        request_id: The id that the frame carried, where one could be read.
    """

    def __init__(self, message: str, *, code: str = "malformed", request_id: int | None = None):
        super().__init__(message)
        self.code = code
        self.request_id = request_id


class RobotError(BodyschemaError):
    """The robot answered a request with an error.

    Attributes:
        code: A key of ``ERROR_CODES``, or one that a later version of the protocol added.
        message: What happened, one sentence.
        advice: What to do about it, one sentence.
        retryable: Whether the same request may succeed later without a person's help.
    """

    def __init__(
        self, code: str, message: str, *, advice: str | None = None, retryable: bool | None = None
    ):
        kind = ERROR_CODES.get(code, _UNKNOWN)
        self.code = code
        self.message = message
        self.advice = advice if advice is not None else kind.advice
        self.retryable = retryable if retryable is not None else kind.retryable
        super().__init__(f"{message} {self.advice}".strip())


class EndpointError(BodyschemaError, ValueError):
    """An address is no address, is in use, or may not be used without keys."""


class KeysError(BodyschemaError, ValueError):
    """A key or a file of a key directory is missing, wrong, or open to others."""


class RobotUnreachableError(BodyschemaError, TimeoutError):
    """Nothing answered in time: nothing listens there, keys do not fit, or the link is cut."""


class RobotRestartedError(BodyschemaError):
    """The daemon restarted, so the outcome of the request in flight is unknown.

    The client never repeats a motion by itself: whether to perform it again is for a person, or a
    program that knows the robot to be safe, to decide.
    """


@dataclass(frozen=True)
class ErrorKind:
    """One row of the error table."""

    retryable: bool
    meaning: str
    advice: str


_UNKNOWN: Final = ErrorKind(False, "A later version of the protocol knows.", "See its SPEC.md.")

ERROR_CODES: Final = MappingProxyType(
    {
        "malformed": ErrorKind(
            False, "The frame is not a valid message.", "Correct the client: see SPEC.md."
        ),
        "too_large": ErrorKind(False, "The frame exceeds 64 KiB.", "Send smaller frames."),
        "unknown_type": ErrorKind(
            False, "No request has this type.", "Use a request type of this protocol version."
        ),
        "unsupported_version": ErrorKind(
            False, "No offered protocol version is spoken here.", "Install a matching client."
        ),
        "restarted": ErrorKind(
            False,
            "The session is unknown: the daemon restarted or forgot this client.",
            "Say hello again; a motion in flight may or may not have happened.",
        ),
        "id_reused": ErrorKind(
            False, "This id was used for another request.", "Give each request a new id."
        ),
        "expired": ErrorKind(
            False,
            "This id is older than what the robot remembers.",
            "It may have been carried out before: find out before you send it under a new id.",
        ),
        "out_of_order": ErrorKind(
            False,
            "A larger id came before this one, which was never carried out.",
            "Send it under a new, larger id.",
        ),
        "too_many_clients": ErrorKind(
            True, "All places for clients are in use.", "Try again when a client has left."
        ),
        "held": ErrorKind(
            True,
            "Another controller holds the robot.",
            f"Wait until it releases, or ask its owner, whom this names: {STATUS}",
        ),
        "not_controller": ErrorKind(
            False, "This request needs control of the robot.", "Send acquire first."
        ),
        "busy": ErrorKind(True, "The robot is carrying out a motion.", "Wait for its end."),
        "bad_targets": ErrorKind(
            False,
            "The targets do not name every joint exactly once.",
            "Give one angle for each joint that hello lists.",
        ),
        "out_of_range": ErrorKind(
            False, "A target lies beyond its joint's limits.", "Stay within hello's limits."
        ),
        "wrong_state": ErrorKind(
            False,
            "The request is not allowed in the robot's present state.",
            f"See SPEC.md; a limp robot moves after: {HOLD}",
        ),
        "stopped": ErrorKind(
            False, "The robot is stopped.", f"Make sure that it is safe, then: {CLEAR}"
        ),
        "fault": ErrorKind(
            False, "A device failed and the robot is down.", f"Mend the cause, then: {CLEAR}"
        ),
        "not_confirmed": ErrorKind(
            True,
            "The robot did not confirm a stop in time: its control loop does not turn.",
            "Cut the servos' power if anything moves; the robot freezes as soon as the loop turns.",
        ),
        "not_planar": ErrorKind(
            True,
            "In its zero pose the robot does not lie flat, or stand as it did at first.",
            "Put the robot back as it lay or stood at first, then retry.",
        ),
        "not_settled": ErrorKind(
            True, "The robot did not come to rest in time.", "Retry, or take away what shakes it."
        ),
        "aborted_stop": ErrorKind(
            False,
            "A stop ended the request.",
            f"Make sure that it is safe; then send a new request after: {CLEAR}",
        ),
        "aborted_hold": ErrorKind(True, "A hold ended the motion.", "Send a new request."),
        "aborted_relax": ErrorKind(
            False, "A relax ended the motion.", f"Send a new request after: {HOLD}"
        ),
        "aborted_silent": ErrorKind(
            True,
            "The controller fell silent or let go; the robot holds its pose.",
            "Keep control and heartbeats, then send a new request.",
        ),
        "aborted_read": ErrorKind(
            True, "A command of the controller ended the read.", "Send a new read."
        ),
        "stale": ErrorKind(True, "A sensor has no fresh value.", "Retry; check the sensor."),
        "shutting_down": ErrorKind(
            True, "The daemon is parking and exits.", "Wait for its restart."
        ),
        "unauthorised": ErrorKind(
            False, "This client may not do that.", "Ask the robot's owner for the role."
        ),
    }
)
