"""``RobotClient``: controls a robot over the wire."""

from __future__ import annotations

import math
import os
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeAlias, TypeVar

from protocol.errors import (
    BodyschemaError,
    RemoteProtocolError,
    RobotError,
    RobotRestartedError,
    RobotUnreachableError,
)
from protocol.rules.client_core import Call, ClientCore
from protocol.security.keys import ClientKeys, KeyDirectory
from protocol.sockets.zmq_sockets import Endpoint
from protocol.system.process import Closable
from protocol.transport.client_thread import ClientThread
from protocol.transport.connection_probe import probe
from protocol.wire.capabilities import Capabilities
from protocol.wire.declaration import Message
from protocol.wire.messages import (
    FINAL_REPLIES,
    PROTOCOL_VERSION,
    Acquire,
    Clear,
    Heartbeat,
    Hello,
    Hold,
    ObservationReply,
    Ok,
    Perform,
    Progress,
    Read,
    Relax,
    Release,
    Request,
    SessionRequest,
    Status,
    Stop,
    Welcome,
)

OnProgress: TypeAlias = Callable[[Progress], None]
R = TypeVar("R", bound=Message)

_FAREWELL: Final = 1.0  # s that close waits for its release to be answered


class RobotClient(Closable):
    """A connection to a robot, with a session.

    Use it as a context manager: leaving it gives control back. Every method may be called from any
    thread; ``stop`` and ``hold`` also while another thread waits in ``perform``. Ctrl-C ends the
    wait; the robot then holds its pose as soon as the client is closed.

    All methods that ask the robot raise ``RobotError`` where it answers with an error,
    ``RobotUnreachableError`` where it does not answer for ``timeout``, and ``RobotRestartedError``
    where it no longer knows the session: then ``hello`` opens another, and nothing is repeated
    unasked.

    Args:
        uri: Address of the robot, ``tcp://host:port``.
        client_id: Id of the client, the same over all starts of a program; default: a new UUID.
        timeout: Seconds of silence from the robot after which to give up. Motions may take
            longer: the robot is asked about them in between.
        next_id: The first request id to use, unless the robot has seen a larger one of this client
            id; above all ids that this client id has used before.
        resume_session: The session that earlier requests were made in, to learn whether the robot
            still knows them (``restarted``).
        software: Name and version of the program, for people.
        keys: The key directory, where the robot asks for keys: see ``protocol.security.keys``.

    Raises:
        EndpointError: ``uri`` is no address.
        KeysError: The key directory cannot be used.
        RobotUnreachableError: Nothing answers there, or the keys do not fit; it says which.
        RobotError: ``unsupported_version``, ``too_many_clients`` or ``unauthorised``.
    """

    def __init__(
        self,
        uri: str,
        *,
        client_id: str | None = None,
        timeout: float = 10.0,
        next_id: int = 1,
        resume_session: str | None = None,
        software: str = "bodyschema",
        keys: str | os.PathLike[str] | None = None,
    ):
        self._uri = str(Endpoint.parse(uri))
        self._client = client_id or str(uuid.uuid4())
        self._timeout = timeout
        self._software = software
        self._lock = threading.Lock()  # ids leave in the order in which they are drawn
        self._next_id = next_id
        self._session = resume_session
        self._first_id = 0
        self._restarted = False
        self._holding = False
        self._core = ClientCore(self._client, peer=self._uri, now=time.monotonic())
        client_keys = KeyDirectory(keys).client_keys() if keys is not None else None
        self._thread = ClientThread(self._uri, self._core, keys=client_keys)
        try:
            self._meet(client_keys)
        except BaseException:
            self._thread.close()
            raise

    def close(self) -> None:
        """Gives back the control that it may have, and closes the connection; idempotent."""
        try:
            if self._holding:
                self._holding = False
                self._ask(self._in_session(Release), Ok, patience=min(_FAREWELL, self._timeout))
        except BodyschemaError:
            return  # the robot frees itself of a controller that it no longer hears
        finally:
            self._thread.close()

    # --- what is known ----------------------------------------------------------------------------

    @property
    def capabilities(self) -> Capabilities:
        """What the robot said about itself in the last hello."""
        return self._capabilities

    @property
    def telemetry_endpoint(self) -> str:
        """Address at which to subscribe to the robot's telemetry."""
        return str(Endpoint.parse(self._capabilities.telemetry).seen_from(self._uri))

    @property
    def client_id(self) -> str:
        """Id of this client; save it to be recognised after a restart of the program."""
        return self._client

    @property
    def session(self) -> str:
        """The session of the last hello; save it beside the request ids."""
        assert self._session is not None
        return self._session

    @property
    def restarted(self) -> bool:
        """Whether hello found another session than the one to be resumed.

        The fate of requests that were in flight in the old one is unknown.
        """
        return self._restarted

    @property
    def next_id(self) -> int:
        """The id that the next numbered request will take."""
        return self._next_id

    def reserve_id(self) -> int:
        """Takes an id for a later ``perform``, to be written down before the robot moves.

        Ids must reach the robot in growing order: use it before any other request is made.
        """
        with self._lock:
            self._next_id += 1
            return self._next_id - 1

    # --- what the robot can be asked --------------------------------------------------------------

    def hello(self) -> Welcome:
        """Opens the session anew: needed only after ``RobotRestartedError``."""
        welcome = self._ask(
            lambda _: Hello(
                id=next(self._core.loose_ids),
                client=self._client,
                versions=(PROTOCOL_VERSION,),
                software=self._software,
            ),
            Welcome,
        )
        if self._session not in (None, welcome.session):
            self._restarted = True
            self._holding = False
            self._first_id = self._next_id
        if welcome.last_id is not None:  # of an earlier start of the program
            self._next_id = max(self._next_id, welcome.last_id + 1)
        self._session = welcome.session
        self._capabilities = welcome.capabilities
        return welcome

    def _meet(self, keys: ClientKeys | None) -> None:
        try:
            self.hello()
        except RobotUnreachableError as error:
            diagnosis = probe(self._uri, keys)  # a busy robot's refusal may come late
            raise RobotUnreachableError(
                str(error) if diagnosis.fine else diagnosis.sentence
            ) from None

    def acquire(self) -> Ok:
        """Takes control; the error ``held`` tells who has it."""
        self._holding = True  # perhaps: the answer may be lost, or not waited for
        try:
            return self._ask(self._in_session(Acquire), Ok)
        except RobotError:
            self._holding = False
            raise

    def release(self) -> Ok:
        """Gives control back; a motion of this client that is under way ends where it is."""
        reply = self._ask(self._in_session(Release), Ok)
        self._holding = False
        return reply

    def perform(
        self,
        targets: Mapping[str, float],
        *,
        request_id: int | None = None,
        on_progress: OnProgress | None = None,
        timeout: float | None = None,
    ) -> ObservationReply:
        """Performs one motor program: return to zero, slew to the targets, settle, read.

        Args:
            targets: Target angle of every joint, rad.
            request_id: An id from ``reserve_id``, of this program or of an earlier start of it. The
                robot carries an id out at most once: asking again brings the same observation.
            on_progress: Called in this thread with each progress.
            timeout: Seconds after which not to wait any longer, although the robot answers.

        Raises:
            RobotRestartedError: Also, without asking the robot, for an id that was drawn in a
                session that the robot no longer knows.
        """
        if request_id is not None and request_id < self._first_id:
            raise RobotRestartedError(
                f"Request {request_id} belongs to a session that the robot at {self._uri} no "
                "longer knows; whether it was carried out is unknown, and it is not repeated."
            )
        return self._ask(
            self._in_session(Perform, request_id=request_id, targets=targets),
            ObservationReply,
            on_progress=on_progress,
            limit=math.inf if timeout is None else timeout,
        )

    def read(self, *, on_progress: OnProgress | None = None) -> ObservationReply:
        """Reads the sensors in the present pose."""
        return self._ask(self._in_session(Read), ObservationReply, on_progress=on_progress)

    def hold(self) -> Ok:
        """Ends a motion and holds the pose."""
        return self._ask(self._in_session(Hold), Ok)

    def relax(self) -> Ok:
        """Lets the servos go limp."""
        return self._ask(self._in_session(Relax), Ok)

    def stop(self) -> Ok:
        """Freezes the robot, whoever controls it; it stays so until ``clear``.

        Raises:
            RobotError: Also ``not_confirmed``: the robot's control loop does not turn, and nobody
                knows whether the robot still moves. The stop stays in force.
        """
        return self._ask(lambda _: Stop(id=next(self._core.loose_ids), client=self._client), Ok)

    def clear(self) -> Ok:
        """Ends a stop or a fault; needs control."""
        return self._ask(self._in_session(Clear), Ok)

    def status(self) -> Status:
        """What the robot is doing, and who controls it."""
        session = self._require_session()
        return self._ask(
            lambda _: Heartbeat(
                id=next(self._core.loose_ids), client=self._client, session=session
            ),
            Status,
        )

    # --- asking -----------------------------------------------------------------------------------

    def _require_session(self) -> str:
        if self._core.session is None:
            raise RobotRestartedError(
                f"The daemon at {self._uri} restarted, or forgot this client: nothing was sent. "
                "Look at the robot, then say hello again."
            )
        return self._core.session

    def _in_session(
        self, kind: type[SessionRequest], *, request_id: int | None = None, **fields: Any
    ) -> Callable[[int], Request]:
        session = self._require_session()

        def build(next_id: int) -> Request:
            number = next_id if request_id is None else request_id
            return kind(id=number, client=self._client, session=session, **fields)

        return build

    def _ask(
        self,
        build: Callable[[int], Request],
        expected: type[R],
        *,
        patience: float | None = None,
        limit: float = math.inf,
        on_progress: OnProgress | None = None,
    ) -> R:
        with self._lock:
            request = build(self._next_id)
            call = Call(request, patience=patience or self._timeout, limit=limit)
            if request.id == self._next_id:
                self._next_id += 1
            self._thread.ask(call)
        try:
            while True:
                answer = call.answers.get()
                if isinstance(answer, BaseException):
                    raise answer
                if isinstance(answer, expected):
                    return answer
                if isinstance(answer, Progress) and on_progress is not None:
                    on_progress(answer)
                elif isinstance(answer, FINAL_REPLIES):
                    raise RemoteProtocolError(f"{call} was answered with {answer.TYPE}.")
        finally:
            self._thread.forget(call)
