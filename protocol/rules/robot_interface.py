"""The interface between the server and a robot.

The server owns a thread and the wire; the robot owns its control loop. Requests go in through
``submit``; what became of them comes back as events, which the server drains when the robot calls
the function given to ``set_notify``. Sessions, ids, lease and silence are the server's business: a
robot only sees requests that somebody was allowed to make.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from protocol.wire.capabilities import Capabilities
from protocol.wire.messages import (
    ErrorReply,
    ObservationReply,
    Ok,
    RobotRequest,
    State,
    Status,
    Telemetry,
)

FinalReply: TypeAlias = ObservationReply | Ok | ErrorReply
"""How a robot ends a request: ``Perform`` and ``Read`` with an observation, the others with ok."""


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """A robot at one moment.

    Attributes:
        state: What the robot is doing.
        robot_time: Time of the robot clock, s.
        sequence: Sequence number of the last observation, 0 before the first.
        angles: The angles last commanded, after quantisation and clamping, by joint, rad.
        reason: Why it is in this state, where there is something to say (fault, stop, silence).
    """

    state: State
    robot_time: float
    sequence: int
    angles: Mapping[str, float]
    reason: str | None = None

    def status(self, request_id: int, controller: str | None) -> Status:
        """Answer to a heartbeat of this id; ``controller`` is the client in control."""
        return Status(
            id=request_id,
            state=self.state.value,
            robot_time=self.robot_time,
            sequence=self.sequence,
            controller=controller,
            reason=self.reason,
        )

    def telemetry(self, robot: str, controller: str | None) -> Telemetry:
        """Publication for the robot of this name; ``controller`` is the client in control."""
        return Telemetry(
            robot=robot,
            state=self.state.value,
            robot_time=self.robot_time,
            sequence=self.sequence,
            angles=self.angles,
            controller=controller,
            reason=self.reason,
        )


@dataclass(frozen=True, kw_only=True)
class Progressed:
    """Progress of a motion; ``phase`` and ``fraction`` as in ``wire.messages.Progress``."""

    ticket: int
    phase: str
    fraction: float
    robot_time: float


@dataclass(frozen=True, kw_only=True)
class Finished:
    """The end of a request; the reply carries the request's id."""

    ticket: int
    reply: FinalReply


RobotEvent: TypeAlias = Progressed | Finished


class Robot(Protocol):
    """A robot as the server sees it.

    The server calls every method from its own thread; ``submit``, ``silence`` and
    ``controller_changed`` must return within about a millisecond.
    """

    @property
    def capabilities(self) -> Capabilities:
        """What the robot is; constant. The server fills in telemetry endpoint and rate."""
        ...

    def submit(self, ticket: int, request: RobotRequest) -> None:
        """Takes on a request; exactly one ``Finished`` with this ticket must follow.

        Commands are carried out in their order and before every ``Read``. They end each ``Read``
        that was taken on before them; a ``Stop`` ends every command, too, that is not done. A
        ``Stop`` that has not ended within ``server_core.CONFIRMATION`` is answered
        ``not_confirmed``, and its end is told to nobody.

        ``Perform`` names every joint once and within its limits. Tickets grow and are never
        reused. After a refusal no event with this ticket may follow.

        Raises:
            RobotError: The robot refuses (``busy``, ``stopped``, ``fault``, …).
        """
        ...

    def silence(self, reason: str) -> None:
        """The controller has fallen silent, or has let go in mid-motion.

        Hold the present pose, end a ``Perform`` with ``aborted_silent``. Called once per silence,
        whatever the state.

        Args:
            reason: What happened, a sentence: for the error, and for ``reason`` in the snapshot.
        """
        ...

    def controller_changed(self, client: str | None) -> None:
        """Another client controls the robot from now on, or nobody does (``None``).

        Called before the new controller's acquire is answered: the moment to note that the zero
        pose must be taken anew.
        """
        ...

    def snapshot(self) -> Snapshot:
        """The robot's present state, returned at once whatever the control loop is doing.

        The state is the one that the joints have reached, not the one that was asked for.
        """
        ...

    def events(self) -> Sequence[RobotEvent]:
        """Takes out the events that wait, those of each request in their order, without blocking.

        If some are left for the next call, the robot notifies again.
        """
        ...

    def set_notify(self, notify: Callable[[], None]) -> None:
        """Gives the function to call, from any thread, whenever events begin to wait."""
        ...
