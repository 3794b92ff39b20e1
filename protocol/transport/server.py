"""The server loop: ZeroMQ sockets around ``ServerCore``, a robot behind it.

One thread runs ``run``. It sleeps until a frame arrives, the robot has something to say, or a
deadline of the core or the next publication is due; idle, it wakes for nothing else. A turn takes
few frames, so that none of these keeps the others waiting.
"""

from __future__ import annotations

import logging
import os
import selectors
import threading
import time
from collections.abc import Callable, Hashable, Iterable
from contextlib import ExitStack
from dataclasses import replace
from typing import Final

import zmq

from protocol.errors import RemoteProtocolError, RobotError
from protocol.rules.robot_interface import Finished, Robot
from protocol.rules.server_core import (
    Action,
    ControllerChanged,
    Send,
    ServerCore,
    Silence,
    Submit,
    allow_all,
)
from protocol.security.access import Access, ZapHandler
from protocol.security.keys import KeyDirectory
from protocol.sockets.tcp_listener import Arrival, TcpListener
from protocol.sockets.zmq_sockets import DEFAULT_BIND, Waker, permitted
from protocol.system.process import Closable
from protocol.transport.telemetry import Publisher
from protocol.wire.codec import MAX_MESSAGE
from protocol.wire.messages import ErrorReply, Request, Stop

_BUDGET: Final = 0.002  # s for frames before the robot and the clock have their turn
_LOOK_INTERVAL: Final = 0.5  # s between two looks at the list of clients
_REQUEST_SHARE: Final = 2 / 3  # of all connections are for requests, the others for telemetry
_QUIET: Final = 0.02  # s without a byte, then nothing is on its way any more
_FAREWELL: Final = 200  # ms that the last replies have to leave


class _Requests(TcpListener):
    """The listener for requests."""

    KIND = zmq.ROUTER
    WINDOW = MAX_MESSAGE + (1 << 18)  # a message and its framing
    CHUNK = 8192


class Server(Closable):
    """Serves one robot at one address.

    Args:
        robot: Robot that carries the requests out.
        bind: ``tcp://host:port``; port 0 or ``*`` takes any free one.
        telemetry_bind: Address for telemetry; default: that of ``bind`` with the next port.
        telemetry_rate: Publications per second.
        keys: The robot's key directory: only clients that it knows can connect, and each may do
            what its role allows. Changes of the list take effect at once.
        insecure: Allows an address that other computers can reach without keys, although nothing
            then keeps anybody there from moving the robot.
        clock: The transport clock, s; it drives leases and publications.
        log: Log for what a person may want to know.

    Attributes:
        endpoint: Address for requests, with the real port.
        telemetry_endpoint: Address of the telemetry, with the real port.

    Raises:
        EndpointError: An address is none, cannot be bound, or would be open to others.
        KeysError: The key directory cannot be used.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        bind: str = DEFAULT_BIND,
        telemetry_bind: str | None = None,
        telemetry_rate: float = 2.0,
        keys: str | os.PathLike[str] | None = None,
        insecure: bool = False,
        clock: Callable[[], float] = time.monotonic,
        log: logging.Logger | None = None,
    ):
        self._robot = robot
        self._clock = clock
        self._log = log or logging.getLogger(__name__)
        directory = KeyDirectory(keys) if keys is not None else None
        pair = directory.pair() if directory is not None else None
        self._access = Access(directory, self._log) if directory is not None else None
        self._list_version = self._access.version if self._access is not None else 0
        place = permitted(bind, keys=directory is not None, insecure=insecure)
        telemetry_place = permitted(
            telemetry_bind or str(place.next_port()), keys=directory is not None, insecure=insecure
        )
        self._period = 1.0 / telemetry_rate
        self._stopping = False
        self._closed = False
        self._running = threading.Lock()
        with ExitStack() as stack:
            self._selector = selectors.DefaultSelector()
            stack.callback(self._selector.close)
            self._waker = Waker()
            stack.callback(self._waker.close)
            self._selector.register(self._waker, selectors.EVENT_READ, self._waker.rest)
            self._context = zmq.Context()
            stack.callback(self._context.destroy, linger=0)
            if self._access is not None:
                zap = ZapHandler(self._context, self._access.admits, self._log)
                self._selector.register(zap, selectors.EVENT_READ, zap.answer)
            shared = (self._context, self._selector)
            self._listener = _Requests(*shared, place, pair, share=_REQUEST_SHARE, log=self._log)
            stack.callback(self._listener.close, _FAREWELL)
            self._publisher = Publisher(
                *shared, telemetry_place, pair, share=1 - _REQUEST_SHARE, log=self._log
            )
            stack.callback(self._publisher.close, 0)
            self._resources = stack.pop_all()
        self.endpoint = str(self._listener.place)
        self.telemetry_endpoint = str(self._publisher.place)
        capabilities = replace(
            robot.capabilities, telemetry=self.telemetry_endpoint, telemetry_rate=telemetry_rate
        )
        self._refusals = LogLimiter()
        self._user: str | None = None  # who sent the frame that is being handled, where known
        self._core = ServerCore(
            capabilities,
            view=robot.snapshot,
            authorise=self._access.authorise if self._access is not None else allow_all,
            on_refusal=self._report_refusal,
        )
        robot.set_notify(self.wake)

    @property
    def garbage(self) -> int:
        """Number of frames since the start that were no valid request."""
        return self._core.garbage

    def run(self) -> None:
        """Serves until ``request_stop`` or ``close``; call it once."""
        with self._running:
            if self._closed:
                return
            publish_at = self._clock()
            while not self._stopping:
                self._wait(self._patience(publish_at))
                self._guard()
                self._take_frames()  # before the clock's turn: a stall of ours is not their silence
                self._publisher.listen()
                self._take_events()
                now = self._clock()
                self._carry_out(self._core.tick(now))
                if now >= publish_at:
                    self._publisher.publish(self._core.publication())
                    publish_at = max(publish_at + self._period, now)  # late once, not slow
            self._finish()

    def wake(self) -> None:
        """Wakes the loop; from any thread."""
        self._waker.wake()

    def request_stop(self) -> None:
        """Has ``run`` return soon; from any thread or signal handler."""
        self._stopping = True
        self.wake()

    def close(self) -> None:
        """Stops ``run``, waits for it to return, and closes the sockets; not from ``run``."""
        self.request_stop()
        with self._running:
            if not self._closed:
                self._closed = True
                self._resources.close()

    # --- the loop's steps -------------------------------------------------------------------------

    def _patience(self, publish_at: float) -> float:
        if self._listener.waiting or self._publisher.waiting:
            return 0.0
        wake_at = publish_at
        if self._access is not None:
            wake_at = min(wake_at, self._clock() + _LOOK_INTERVAL)
        if self._core.deadline is not None:
            wake_at = min(wake_at, self._core.deadline)
        return max(0.0, wake_at - self._clock())

    def _wait(self, patience: float) -> bool:
        """Sleeps until something happens, and moves what bytes there are; returns whether any."""
        ready = self._selector.select(patience)
        for key, events in ready:
            handle: Callable[[int], None] = key.data
            handle(events)
        return bool(ready)

    def _finish(self) -> None:
        """Answers what has arrived by now."""
        end = time.monotonic() + _FAREWELL / 1000
        while self._wait(_QUIET) and time.monotonic() < end:
            self._take_frames()
            self._take_events()
        self._take_frames()
        self._take_events()

    def _guard(self) -> None:
        """Applies a list of clients that has changed."""
        if self._access is None:
            return
        version = self._access.refresh()
        if version != self._list_version:
            self._list_version = version
            role_of = self._access.role_of
            self._carry_out(self._core.review(role_of))
            self._publisher.dismiss(lambda user: role_of(user) is None)

    def _take_frames(self) -> None:
        for arrival in self._listener.arrivals(time.monotonic() + _BUDGET):
            garbage = self._core.garbage
            self._carry_out(self._taken(arrival))
            if self._core.garbage != garbage:
                self._report_garbage()

    def _taken(self, arrival: Arrival) -> Iterable[Action]:
        peer, self._user, parts = arrival
        if len(parts) == 1:
            return self._core.receive(peer, parts[0], self._clock(), self._user)
        error = RemoteProtocolError(f"A message is one frame, not {len(parts)}.")
        return [self._core.complain(peer, error)]

    def _report_garbage(self) -> None:
        count = self._core.garbage
        if count & (count - 1) == 0:  # at 1, 2, 4, 8, …: a flood cannot fill the log
            self._log.warning("%d frames so far were no valid request", count)

    def _report_refusal(self, request: Request, error: RobotError) -> None:
        kept_back = self._refusals.count((request.TYPE, error.code), self._clock())
        if kept_back is None:
            return
        self._log.info(
            "refused: %s of %s: %s: %s%s",
            request.TYPE,
            self._asking(request),
            error.code,
            error.message,
            f" ({kept_back} such refusals before this one are not shown)" if kept_back else "",
        )

    def _asking(self, request: Request) -> str:
        """Who sent the request that is being handled: the key's owner, whatever client it names."""
        client = f"client {request.client}"
        if self._access is None or self._user is None:
            return client
        return f"{self._access.name_of(self._user)} as {client}"

    def _take_events(self) -> None:
        for event in self._robot.events():
            try:
                if isinstance(event, Finished):
                    actions = self._core.finish(event)
                else:
                    actions = self._core.progress(event)
            except (KeyError, ValueError):  # a bug that must leave the others a daemon to stop
                self._log.exception("the robot told of a request that is not under way: %r", event)
            else:
                self._carry_out(actions)

    def _carry_out(self, actions: Iterable[Action]) -> None:
        for action in actions:
            if isinstance(action, Send):
                self._send(action)
            elif isinstance(action, Submit):
                self._submit(action)
            elif isinstance(action, Silence):
                self._log.warning("nobody steers any more: the robot holds")
                self._robot.silence(action.reason)
            elif isinstance(action, ControllerChanged):
                self._log.info("control: %s", action.reason)
                self._robot.controller_changed(action.client)

    def _submit(self, action: Submit) -> None:
        request = action.request
        if isinstance(request, Stop) and self._user is not None:
            self._log.info("stop of %s", self._asking(request))
        try:
            self._robot.submit(action.ticket, request)
        except RobotError as error:
            refusal = error
            self._report_refusal(request, error)
        except Exception:
            # A bug met by one request must not end the daemon and leave the others without stop.
            self._log.exception("the robot failed to take on %s", request.TYPE)
            refusal = RobotError("fault", f"The daemon failed on {request.TYPE}; see its log.")
        else:
            self._carry_out(self._core.accept(action.ticket))
            return
        reply = ErrorReply.of(refusal, request_id=request.id)
        self._carry_out(self._core.finish(Finished(ticket=action.ticket, reply=reply)))

    def _send(self, action: Send) -> None:
        self._listener.send(action.peer, [action.frame])


PERIOD: Final = 60.0
"""Shortest time between two events of a kind that a ``LogLimiter`` lets through, s."""


class LogLimiter:
    """Lets one event of a kind through, then at most one in each period, and counts the others.

    It remembers every kind, so there must be a bounded number of them.
    """

    def __init__(self) -> None:
        self._kinds: dict[Hashable, tuple[float, int]] = {}

    def count(self, kind: Hashable, now: float) -> int | None:
        """Counts an event that happened at ``now`` (s).

        Returns:
            How many of its kind were kept back since the last one that was let through, or
            ``None`` when this one is kept back too.
        """
        since, kept_back = self._kinds.get(kind, (-float("inf"), 0))
        if now - since < PERIOD:
            self._kinds[kind] = since, kept_back + 1
            return None
        self._kinds[kind] = now, 0
        return kept_back
