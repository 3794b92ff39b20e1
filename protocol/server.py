"""The server loop: ZeroMQ sockets around ``ServerCore``, a robot behind it.

One thread runs ``run``. It sleeps until a frame arrives, the robot has something to say, or a
deadline of the core or the next publication is due; idle, it wakes for nothing else.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from types import TracebackType
from typing import Final, Self

import zmq

from protocol.codec import MAX_MESSAGE
from protocol.core import Action, ControllerChanged, Send, ServerCore, Silence, Submit
from protocol.endpoints import DEFAULT_BIND, Endpoint
from protocol.errors import EndpointError, RemoteProtocolError, RobotError
from protocol.messages import ErrorReply
from protocol.robot import Finished, Robot
from protocol.telemetry import TOPIC
from protocol.waker import Waker

_QUEUE: Final = 256  # frames that may wait for a slow peer, then some are dropped
_BATCH: Final = 100  # frames before the robot and the clock have their turn
_FAREWELL: Final = 200  # ms that the last replies have to leave
_KEEPALIVE: Final = ((zmq.TCP_KEEPALIVE, 1), (zmq.TCP_KEEPALIVE_IDLE, 30))  # finds dead peers


class Server:
    """Serves one robot at one address.

    Args:
        robot: What carries requests out.
        bind: ``tcp://host:port``; port 0 or ``*`` takes any free one.
        telemetry_bind: The same for publications; default: the port after ``bind``'s.
        telemetry_rate: Publications per second.
        insecure: Allows an address that other computers can reach, although nothing then keeps
            anybody there from moving the robot.
        clock: The transport clock, s; it drives leases and publications.
        log: Where to write what a person may want to know.

    Attributes:
        endpoint: Where requests are taken, with the real port.
        telemetry_endpoint: Where publications are made, with the real port.

    Raises:
        EndpointError: The address is none, cannot be bound, or would be open to others.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        bind: str = DEFAULT_BIND,
        telemetry_bind: str | None = None,
        telemetry_rate: float = 2.0,
        insecure: bool = False,
        clock: Callable[[], float] = time.monotonic,
        log: logging.Logger | None = None,
    ):
        place = _permitted(bind, insecure)
        telemetry_place = _permitted(telemetry_bind or str(place.next_port()), insecure)
        self._robot = robot
        self._clock = clock
        self._log = log or logging.getLogger(__name__)
        self._period = 1.0 / telemetry_rate
        self._stopping = False
        self._closed = False
        self._running = threading.Lock()
        self._waker = Waker()
        self._context = zmq.Context()
        try:
            self._router = self._bound(zmq.ROUTER, place)
            self._publisher = self._bound(zmq.PUB, telemetry_place)
        except BaseException:
            self._dispose()
            raise
        self.endpoint = _real(self._router, place)
        self.telemetry_endpoint = _real(self._publisher, telemetry_place)
        capabilities = replace(
            robot.capabilities, telemetry=self.telemetry_endpoint, telemetry_rate=telemetry_rate
        )
        self._core = ServerCore(capabilities, view=robot.snapshot)
        robot.set_notify(self.wake)

    @property
    def garbage(self) -> int:
        """Frames that were no valid request, since the start."""
        return self._core.garbage

    def run(self) -> None:
        """Serves until ``request_stop`` or ``close``; call it once."""
        with self._running:
            if self._closed:
                return
            poller = zmq.Poller()
            poller.register(self._router, zmq.POLLIN)
            poller.register(self._waker.fileno(), zmq.POLLIN)
            publish_at = self._clock()
            while not self._stopping:
                poller.poll(self._patience(publish_at))
                self._waker.rest()
                self._take_frames()  # before the clock's turn: a stall of ours is not their silence
                self._take_events()
                now = self._clock()
                self._carry_out(self._core.tick(now))
                if now >= publish_at:
                    self._publish()
                    publish_at = now + self._period
            self._take_events()

    def wake(self) -> None:
        """Makes the loop look around now; from any thread."""
        self._waker.wake()

    def request_stop(self) -> None:
        """Makes ``run`` return soon; from any thread or signal handler."""
        self._stopping = True
        self.wake()

    def close(self) -> None:
        """Stops ``run``, waits for it to return, and closes the sockets; not from ``run``."""
        self.request_stop()
        with self._running:
            if not self._closed:
                self._dispose()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # --- the loop's steps -------------------------------------------------------------------------

    def _patience(self, publish_at: float) -> int:
        due = publish_at
        if self._core.deadline is not None:
            due = min(due, self._core.deadline)
        return max(0, math.ceil((due - self._clock()) * 1000))

    def _take_frames(self) -> None:
        for _ in range(_BATCH):
            try:
                peer, *frames = self._router.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            garbage = self._core.garbage
            if len(frames) == 1:
                self._carry_out(self._core.receive(peer, frames[0], self._clock()))
            else:
                error = RemoteProtocolError(f"A message is one frame, not {len(frames)}.")
                self._carry_out([self._core.complain(peer, error)])
            if self._core.garbage != garbage:
                self._report_garbage()

    def _report_garbage(self) -> None:
        count = self._core.garbage
        if count & (count - 1) == 0:  # at 1, 2, 4, 8, …: a flood cannot fill the log
            self._log.warning("%d frames so far were no valid request", count)

    def _take_events(self) -> None:
        for event in self._robot.events():
            if isinstance(event, Finished):
                self._carry_out(self._core.finish(event))
            else:
                self._carry_out(self._core.progress(event))

    def _carry_out(self, actions: Iterable[Action]) -> None:
        for action in actions:
            if isinstance(action, Send):
                self._send(action)
            elif isinstance(action, Submit):
                self._submit(action)
            elif isinstance(action, Silence):
                self._log.warning("nobody steers any more: the robot holds")
                self._robot.silence()
            elif isinstance(action, ControllerChanged):
                self._log.info("controller: %s", action.client or "nobody")
                self._robot.controller_changed(action.client)

    def _submit(self, action: Submit) -> None:
        request = action.request
        try:
            self._robot.submit(action.ticket, request)
        except RobotError as error:
            refusal = error
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
        try:
            self._router.send_multipart([action.peer, action.frame], zmq.NOBLOCK)
        except zmq.Again:
            return  # the peer does not read; it will ask again

    def _publish(self) -> None:
        self._publisher.send_multipart([TOPIC, self._core.publication()], zmq.NOBLOCK)

    # --- sockets ----------------------------------------------------------------------------------

    def _bound(self, kind: int, place: Endpoint) -> zmq.Socket[bytes]:
        made: zmq.Socket[bytes] = self._context.socket(kind)
        options = {
            zmq.LINGER: 0,
            zmq.MAXMSGSIZE: MAX_MESSAGE,
            zmq.SNDHWM: _QUEUE,
            zmq.RCVHWM: _QUEUE,
            zmq.IPV6: int(place.is_ipv6),
            **dict(_KEEPALIVE),
        }
        for option, value in options.items():
            made.setsockopt(option, value)
        try:
            made.bind(str(place))
        except zmq.ZMQError as error:
            made.close()
            raise EndpointError(
                f"Cannot serve at {place}: {error.strerror}. Stop what uses it, or choose another "
                "address."
            ) from None
        return made

    def _dispose(self) -> None:
        self._closed = True
        self._context.destroy(linger=_FAREWELL)
        self._waker.close()


def _permitted(uri: str, insecure: bool) -> Endpoint:
    place = Endpoint.parse(uri)
    if not (place.is_loopback or insecure):
        raise EndpointError(
            f"Other computers can reach {place}, and without keys anybody there could move the "
            f"robot: bind to {DEFAULT_BIND}, or say --insecure."
        )
    return Endpoint("127.0.0.1", place.port) if place.host == "localhost" else place


def _real(bound: zmq.Socket[bytes], place: Endpoint) -> str:
    found = bound.getsockopt_string(zmq.LAST_ENDPOINT)
    host = "*" if place.is_wildcard else place.host
    return str(Endpoint(host, Endpoint.parse(found).port))
