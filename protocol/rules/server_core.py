"""The server's side of the protocol without sockets, threads or clocks.

Frames come in with the time at which they came; out come *actions*, which the caller carries out in
order. What the robot then says goes back in through ``accept``, ``progress`` and ``finish``. So
every rule of the wire can be tried by calling functions.
"""

from __future__ import annotations

import itertools
import secrets
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final, TypeAlias

from protocol.errors import ERROR_CODES, RemoteProtocolError, RobotError
from protocol.rules.at_most_once import Client, Clients, RememberedRequest
from protocol.rules.control import EXPIRY, Lapse, Lease, Role
from protocol.rules.robot_interface import Finished, Progressed, Snapshot
from protocol.wire.capabilities import Capabilities, check_targets
from protocol.wire.codec import decode, encode
from protocol.wire.declaration import Message
from protocol.wire.messages import (
    PROTOCOL_VERSION,
    Accepted,
    Acquire,
    ErrorReply,
    Heartbeat,
    Hello,
    Ok,
    Perform,
    Progress,
    Read,
    Release,
    Request,
    RobotRequest,
    SessionRequest,
    Stop,
    Welcome,
    parse_request,
)

Authorise: TypeAlias = Callable[[str | None, Request], None]
OnRefusal: TypeAlias = Callable[[Request, RobotError], None]
RoleOf: TypeAlias = Callable[[str | None], Role | None]

CONFIRMATION: Final = 0.2
"""Seconds within which a robot confirms a ``stop``; then its sender is told that it did not."""

MAX_READS: Final = 8
"""Reads that the clients of one key may have under way without control of the robot."""


@dataclass(frozen=True, slots=True)
class Send:
    """Send this frame to this peer."""

    peer: bytes
    frame: bytes


@dataclass(frozen=True, slots=True)
class Submit:
    """Give this request to the robot; then call ``accept``, or ``finish`` if it refuses."""

    ticket: int
    request: RobotRequest


@dataclass(frozen=True, slots=True)
class Silence:
    """Tell the robot that it has no active controller; ``reason`` says why, in a sentence."""

    reason: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class ControllerChanged:
    """Tell the robot who controls it now; ``reason``, for the log, says how that came about."""

    client: str | None
    reason: str = field(default="", compare=False)


Action: TypeAlias = Send | Submit | Silence | ControllerChanged


def allow_all(user: str | None, request: Request) -> None:
    """Authorises every request: for a server without keys."""


class ServerCore:
    """The server's state: sessions, request ids and the controller's lease.

    Args:
        capabilities: Capabilities with which hello is answered.
        view: Returns the robot's present snapshot.
        token: Makes the name of a new session, which nobody can guess.
        authorise: Called with user and request before anything else is done; raises
            ``RobotError('unauthorised')`` to refuse.
        on_refusal: Called for each request that is refused here, with the error it is answered
            with; a retry is no new request.

    Attributes:
        garbage: Number of frames that were no valid request.
    """

    def __init__(
        self,
        capabilities: Capabilities,
        *,
        view: Callable[[], Snapshot],
        token: Callable[[], str] = secrets.token_hex,
        authorise: Authorise = allow_all,
        on_refusal: OnRefusal = lambda request, error: None,
    ):
        self.garbage = 0
        self._capabilities = capabilities
        self._view = view
        self._authorise = authorise
        self._on_refusal = on_refusal
        self._clients = Clients(token)
        self._lease = Lease()
        self._tickets = itertools.count(1)
        self._in_flight: dict[int, RememberedRequest] = {}
        self._stops: deque[tuple[float, int]] = deque()  # when to be confirmed, and the ticket
        self._unconfirmed: set[int] = set()  # tickets of stops answered as not confirmed

    @property
    def deadline(self) -> float | None:
        """When ``tick`` is due at the latest; ``None``: not before the next frame."""
        dues = [self._lease.deadline, self._stops[0][0] if self._stops else None]
        return min((due for due in dues if due is not None), default=None)

    @property
    def controller(self) -> str | None:
        """The client that controls the robot."""
        return self._lease.holder

    # --- from the wire ----------------------------------------------------------------------------

    def receive(
        self, peer: bytes, frame: bytes, now: float, user: str | None = None
    ) -> list[Action]:
        """Handles one frame; no content of a frame raises an error.

        Args:
            peer: Where it came from, and where answers go.
            frame: One frame as it came.
            now: Transport clock, s.
            user: Who sent it, where the transport knows.
        """
        try:
            request = parse_request(decode(frame))
        except RemoteProtocolError as error:
            return [self.complain(peer, error)]
        try:
            self._authorise(user, request)
            if isinstance(request, Hello):
                return [self._hello(peer, request, now, user)]
            if isinstance(request, Stop):
                action = self._submit(request, RememberedRequest.of(request, peer))
                self._stops.append((now + CONFIRMATION, action.ticket))
                return [action]
            assert isinstance(request, SessionRequest)
            client = self._clients.find(request.client, session=request.session, user=user)
            self._lease.hear(client.name, now)
            if isinstance(request, Heartbeat):
                status = self._view().status(request.id, self._lease.holder)
                return [_send(peer, status)]
            return self._numbered(client, peer, request, now)
        except RobotError as error:
            self._on_refusal(request, error)
            return [_send(peer, ErrorReply.of(error, request_id=request.id))]

    def complain(self, peer: bytes, error: RemoteProtocolError) -> Send:
        """Counts an invalid frame, and answers it with an error."""
        self.garbage += 1
        answer = RobotError(error.code, str(error))
        return _send(peer, ErrorReply.of(answer, request_id=error.request_id))

    def tick(self, now: float) -> list[Action]:
        """Handles the passing of time; ``now`` is on the transport clock, s."""
        actions: list[Action] = [*self._unconfirmed_by(now)]
        holder = self._lease.holder or ""
        for lapse in self._lease.lapse(now):
            if lapse is Lapse.SILENT:
                actions.append(
                    Silence("The controller was silent for too long; the robot holds its pose.")
                )
            else:
                reason = f"{self._clients.name_of(holder)} was silent for {EXPIRY:g} s"
                actions.append(ControllerChanged(None, reason))
        return actions

    def review(self, role_of: RoleOf) -> list[Action]:
        """Ends sessions and control of clients whose users have lost their roles.

        Args:
            role_of: The present role of a user; ``None`` where it is no longer known.
        """
        actions: list[Action] = []
        for client in self._clients:
            role = role_of(client.user)
            if client.name == self._lease.holder and role is not Role.CONTROLLER:
                reason = f"the key of {self._clients.name_of(client.name)} may no longer control it"
                actions += self._let_go(
                    reason, "The controller's key may no longer control the robot"
                )
            if role is None:
                self._clients.forget(client)
        return actions

    # --- from the robot ---------------------------------------------------------------------------

    def accept(self, ticket: int) -> list[Send]:
        """Handles the robot's acceptance of a request."""
        outcome = self._in_flight[ticket]
        request = outcome.request
        assert request is not None
        outcome.progress = encode(Accepted(id=request.id).to_map())
        is_announced = isinstance(request, RobotRequest) and request.ACCEPTED
        return _to(outcome, outcome.progress) if is_announced else []

    def progress(self, event: Progressed) -> list[Send]:
        """Handles the progress of a motion."""
        outcome = self._in_flight[event.ticket]
        request = outcome.request
        assert request is not None
        message = Progress(
            id=request.id,
            phase=event.phase,
            fraction=event.fraction,
            robot_time=event.robot_time,
        )
        outcome.progress = encode(message.to_map())
        return _to(outcome, outcome.progress)

    def finish(self, event: Finished) -> list[Send]:
        """Handles the end of a request; that of a stop answered ``not_confirmed`` is dropped.

        Raises:
            KeyError: No such request is under way: a bug of the robot.
            ValueError: The reply carries another id than its request: a bug of the robot.
        """
        if event.ticket in self._unconfirmed:
            self._unconfirmed.remove(event.ticket)
            return []
        outcome = self._in_flight[event.ticket]
        request = outcome.request
        assert request is not None
        if event.reply.id != request.id:
            raise ValueError(f"request {request.id} was answered with id {event.reply.id}")
        del self._in_flight[event.ticket]
        return _end(outcome, event.reply)

    def publication(self) -> bytes:
        """The telemetry frame to publish now."""
        message = self._view().telemetry(self._capabilities.robot, self._lease.holder)
        return encode(message.to_map())

    # --- requests ---------------------------------------------------------------------------------

    def _hello(self, peer: bytes, request: Hello, now: float, user: str | None) -> Send:
        if PROTOCOL_VERSION not in request.versions:
            raise RobotError(
                "unsupported_version",
                f"Version {PROTOCOL_VERSION} is spoken here, not {list(request.versions)}.",
            )
        client = self._clients.welcome(
            request.client, user=user, software=request.software, keep=self._lease.holder
        )
        self._lease.hear(client.name, now)
        reply = Welcome(
            id=request.id,
            version=PROTOCOL_VERSION,
            session=client.session,
            robot_time=self._view().robot_time,
            capabilities=self._capabilities,
            last_id=client.highest if client.highest >= 0 else None,
        )
        return _send(peer, reply)

    def _numbered(
        self, client: Client, peer: bytes, request: SessionRequest, now: float
    ) -> list[Action]:
        outcome = client.recall(request)
        if outcome is not None:  # a retry: the answers go to where it came from
            outcome.peer = peer
            frame = outcome.reply or outcome.progress
            return [Send(peer, frame)] if frame is not None else []
        outcome = client.begin(request, peer)
        try:
            if request.NEEDS_CONTROL:
                self._needs_lease(client)
            if isinstance(request, Read):
                self._needs_room(client)
            if isinstance(request, Perform):
                check_targets(self._capabilities.joints, request.targets)
            if isinstance(request, Acquire):
                return self._acquire(client, outcome, now)
            if isinstance(request, Release):
                return self._release(outcome)
            assert isinstance(request, RobotRequest)
            return [self._submit(request, outcome)]
        except RobotError as error:
            self._on_refusal(request, error)
            return [*_end(outcome, ErrorReply.of(error, request_id=request.id))]

    def _unconfirmed_by(self, now: float) -> Iterator[Send]:
        """Answers stops that the robot has not carried out in time."""
        while self._stops and (
            self._stops[0][0] <= now or self._stops[0][1] not in self._in_flight
        ):
            _, ticket = self._stops.popleft()
            outcome = self._in_flight.pop(ticket, None)
            if outcome is not None:
                assert outcome.request is not None
                self._unconfirmed.add(ticket)
                error = RobotError("not_confirmed", ERROR_CODES["not_confirmed"].meaning)
                yield from _end(outcome, ErrorReply.of(error, request_id=outcome.request.id))

    def _needs_room(self, client: Client) -> None:
        """Bounds the reads under way with the key of a client that is not in control."""
        if client.user is None or client.name == self._lease.holder:
            return
        if self._clients.under_way(client.user) > MAX_READS:  # this one counts already
            raise RobotError("busy", f"{MAX_READS} requests with this key are under way already.")

    def _needs_lease(self, client: Client) -> None:
        if self._lease.holder == client.name:
            return
        if self._lease.holder is None:
            raise RobotError("not_controller", "This client does not control the robot.")
        raise RobotError(
            "not_controller",
            f"{self._clients.name_of(self._lease.holder)} controls the robot, not this client.",
        )

    def _acquire(self, client: Client, outcome: RememberedRequest, now: float) -> list[Action]:
        holder = self._lease.holder
        if holder not in (None, client.name):
            raise RobotError("held", f"{self._clients.name_of(holder)} holds the robot.")
        self._lease.take(client.name, now)
        reason = f"{self._clients.name_of(client.name)} acquired it"
        changes: list[Action] = [ControllerChanged(client.name, reason)] if holder is None else []
        return [*changes, *_end(outcome, self._ok(outcome))]

    def _release(self, outcome: RememberedRequest) -> list[Action]:
        assert outcome.request is not None
        reason = f"{self._clients.name_of(outcome.request.client)} released it"
        actions = self._let_go(reason, "The controller released the robot in mid-motion")
        return [*actions, *_end(outcome, self._ok(outcome))]

    def _let_go(self, reason: str, cause: str) -> list[Action]:
        moving = any(isinstance(outcome.request, Perform) for outcome in self._in_flight.values())
        self._lease.free()
        silence: list[Action] = [Silence(f"{cause}; it holds its pose.")] if moving else []
        return [*silence, ControllerChanged(None, reason)]

    def _ok(self, outcome: RememberedRequest) -> Ok:
        assert outcome.request is not None
        return Ok(id=outcome.request.id, state=self._view().state.value)

    def _submit(self, request: RobotRequest, outcome: RememberedRequest) -> Submit:
        ticket = next(self._tickets)
        self._in_flight[ticket] = outcome
        return Submit(ticket, request)


def _send(peer: bytes, message: Message) -> Send:
    return Send(peer, encode(message.to_map()))


def _end(outcome: RememberedRequest, reply: Message) -> list[Send]:
    frame = encode(reply.to_map())
    outcome.end(frame)
    return _to(outcome, frame)


def _to(outcome: RememberedRequest, frame: bytes) -> list[Send]:
    return [Send(outcome.peer, frame)] if outcome.peer is not None else []
