"""The server loop: ZeroMQ sockets around ``ServerCore``, a robot behind it.

One thread runs ``run``. It sleeps until a frame arrives, the robot has something to say, or a
deadline of the core or the next publication is due; idle, it wakes for nothing else.
"""

from __future__ import annotations

import logging
import math
import os
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Final

import zmq

from protocol.access import Access
from protocol.actions import Action, ControllerChanged, Send, Silence, Submit
from protocol.closing import Closing
from protocol.core import ServerCore, allow_all
from protocol.endpoints import DEFAULT_BIND
from protocol.errors import RemoteProtocolError, RobotError
from protocol.gate import Gate
from protocol.keys import KeyDirectory
from protocol.messages import ErrorReply, Request
from protocol.publisher import Publisher
from protocol.robot import Finished, Robot
from protocol.sockets import listening, permitted, real_endpoint
from protocol.tally import Tally
from protocol.waker import Waker

_BATCH: Final = 100  # frames before the robot and the clock have their turn
_LOOK: Final = 0.5  # s between two looks at the list of clients
_FAREWELL: Final = 200  # ms that the last replies have to leave


class Server(Closing):
    """Serves one robot at one address.

    Args:
        robot: What carries requests out.
        bind: ``tcp://host:port``; port 0 or ``*`` takes any free one.
        telemetry_bind: The same for publications; default: the port after ``bind``'s.
        telemetry_rate: Publications per second.
        keys: The robot's key directory: only clients that it knows can connect, and each may do
            what its role allows. Changes of the list take effect at once.
        insecure: Allows an address that other computers can reach without keys, although nothing
            then keeps anybody there from moving the robot.
        clock: The transport clock, s; it drives leases and publications.
        log: Where to write what a person may want to know.

    Attributes:
        endpoint: Where requests are taken, with the real port.
        telemetry_endpoint: Where publications are made, with the real port.

    Raises:
        EndpointError: The address is none, cannot be bound, or would be open to others.
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
        known = KeyDirectory(keys) if keys is not None else None
        pair = known.pair() if known is not None else None
        self._access = Access(known, self._log) if known is not None else None
        self._list = self._access.version if self._access is not None else 0
        place = permitted(bind, keys=known is not None, insecure=insecure)
        telemetry_place = permitted(
            telemetry_bind or str(place.next_port()), keys=known is not None, insecure=insecure
        )
        self._period = 1.0 / telemetry_rate
        self._stopping = False
        self._closed = False
        self._running = threading.Lock()
        self._waker = Waker()
        self._context = zmq.Context()
        try:
            self._gate = (
                Gate(self._context, self._access.admits, self._log) if self._access else None
            )
            self._router = listening(self._context, zmq.ROUTER, place, pair)
            self._publisher = Publisher(self._context, telemetry_place, pair, self._log)
        except BaseException:
            self._dispose()
            raise
        self.endpoint = str(real_endpoint(self._router, place))
        self.telemetry_endpoint = str(self._publisher.place)
        capabilities = replace(
            robot.capabilities, telemetry=self.telemetry_endpoint, telemetry_rate=telemetry_rate
        )
        self._refusals = Tally()
        self._core = ServerCore(
            capabilities,
            view=robot.snapshot,
            authorise=self._access.authorise if self._access is not None else allow_all,
            on_refusal=self._report_refusal,
        )
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
            if self._gate is not None:
                poller.register(self._gate.socket, zmq.POLLIN)
            publish_at = self._clock()
            while not self._stopping:
                poller.poll(self._patience(publish_at))
                self._waker.rest()
                self._guard()
                self._take_frames()  # before the clock's turn: a stall of ours is not their silence
                self._take_events()
                now = self._clock()
                self._carry_out(self._core.tick(now))
                if now >= publish_at:
                    self._publisher.publish(self._core.publication())
                    publish_at = max(publish_at + self._period, now)  # late once, not slow
            self._take_frames()  # what has arrived by now gets its answer
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

    # --- the loop's steps -------------------------------------------------------------------------

    def _patience(self, publish_at: float) -> int:
        due = publish_at
        if self._access is not None:
            due = min(due, self._clock() + _LOOK)
        if self._core.deadline is not None:
            due = min(due, self._core.deadline)
        return max(0, math.ceil((due - self._clock()) * 1000))

    def _guard(self) -> None:
        """Lets new connections in or turns them away; applies a list of clients that changed."""
        if self._access is None or self._gate is None:
            return
        self._gate.answer()
        version = self._access.refresh()
        if version != self._list:
            self._list = version
            self._carry_out(self._core.review(self._access.role_of))
            self._publisher.renew()

    def _take_frames(self) -> None:
        for _ in range(_BATCH):
            try:
                (peer, *frames), user = self._receive()
            except zmq.Again:
                return
            garbage = self._core.garbage
            if len(frames) == 1:
                self._carry_out(self._core.receive(peer, frames[0], self._clock(), user))
            else:
                error = RemoteProtocolError(f"A message is one frame, not {len(frames)}.")
                self._carry_out([self._core.complain(peer, error)])
            if self._core.garbage != garbage:
                self._report_garbage()

    def _receive(self) -> tuple[Sequence[bytes], str | None]:
        """The parts of the next message, and the key of whoever sent it."""
        if self._access is None:
            return self._router.recv_multipart(zmq.NOBLOCK), None
        parts = self._router.recv_multipart(zmq.NOBLOCK, copy=False)
        return [part.bytes for part in parts], _user_of(parts[-1])

    def _report_garbage(self) -> None:
        count = self._core.garbage
        if count & (count - 1) == 0:  # at 1, 2, 4, 8, …: a flood cannot fill the log
            self._log.warning("%d frames so far were no valid request", count)

    def _report_refusal(self, request: Request, error: RobotError) -> None:
        kept_back = self._refusals.count((request.TYPE, error.code), self._clock())
        if kept_back is None:
            return
        self._log.info(
            "refused: %s of client %s: %s: %s%s",
            request.TYPE,
            request.client,
            error.code,
            error.message,
            f" ({kept_back} such refusals before this one are not shown)" if kept_back else "",
        )

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
                self._robot.silence(action.reason)
            elif isinstance(action, ControllerChanged):
                self._log.info("control: %s", action.reason)
                self._robot.controller_changed(action.client)

    def _submit(self, action: Submit) -> None:
        request = action.request
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
        try:
            self._router.send_multipart([action.peer, action.frame], zmq.NOBLOCK)
        except zmq.Again:
            return  # the peer does not read; it will ask again

    def _dispose(self) -> None:
        self._closed = True
        self._context.destroy(linger=_FAREWELL)
        self._waker.close()


def _user_of(frame: zmq.Frame) -> str | None:
    try:
        return str(frame.get("User-Id"))
    except zmq.ZMQError:
        return None  # it came past the gate, which cannot be: it will be refused
