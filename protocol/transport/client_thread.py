"""The client's thread: it owns the socket, sends heartbeats and repeats requests."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import TypeAlias

import zmq

from protocol.rules.client_core import LOOK, Call, ClientCore
from protocol.security.keys import ClientKeys
from protocol.sockets.zmq_sockets import Waker, connected

_Order: TypeAlias = Callable[[float], None]  # something to do in the thread, given the time


class ClientThread:
    """A connection that is made again when the link is cut.

    Args:
        uri: Address of the robot, ``tcp://host:port``.
        core: The requests and replies; from here on only the thread uses it.
        keys: The client's keys and the robot's public one; ``None``: the robot has no keys.

    Raises:
        EndpointError: The address cannot be connected to.
    """

    def __init__(self, uri: str, core: ClientCore, *, keys: ClientKeys | None = None):
        self._uri = uri
        self._core = core
        self._keys = keys
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._orders: SimpleQueue[_Order] = SimpleQueue()
        self._stopping = False
        self._ended = False
        self._closed = False
        self._waker = Waker()
        try:
            self._socket = self._connected()
        except BaseException:
            self._dispose()
            raise
        self._thread = threading.Thread(target=self._run, name=f"link to {uri}", daemon=True)
        self._thread.start()

    def ask(self, call: Call) -> None:
        """Begins a call; what comes back is put into ``call.answers``."""
        self._orders.put(lambda now: self._core.ask(call, now))
        self._waker.wake()
        if self._ended:  # set before the thread fails its last calls: none can be missed
            self._fail()

    def forget(self, call: Call) -> None:
        """Ends a call for which nobody waits any more."""
        self._orders.put(lambda now: self._core.forget(call))
        self._waker.wake()

    def close(self) -> None:
        """Ends the thread and every call, and closes the socket; idempotent."""
        self._stopping = True
        self._waker.wake()
        self._thread.join()
        if not self._closed:
            self._dispose()

    # --- the thread -------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._stopping:
                self._poll()
                now = time.monotonic()
                self._core.wake(now)
                self._obey(now)
                self._hear(now)
                if self._core.tick(now):
                    self._socket.close()
                    self._socket = self._connected()
                self._speak(now)
        finally:
            self._ended = True
            self._socket.close()
            self._fail()

    def _poll(self) -> None:
        now = time.monotonic()
        waiting = bool(self._core.frames(now))  # for a connection, else frames would be lost
        wake_at = self._core.give_up_at
        if not waiting:
            wake_at = min(wake_at, self._core.send_at)
        poller = zmq.Poller()
        poller.register(self._socket, zmq.POLLIN | (zmq.POLLOUT if waiting else 0))
        poller.register(self._waker.fileno(), zmq.POLLIN)
        if wake_at == math.inf:
            poller.poll()
        else:
            poller.poll(math.ceil(min(max(wake_at - now, 0.0), LOOK) * 1000))
        self._waker.rest()

    def _obey(self, now: float) -> None:
        try:
            while True:
                self._orders.get_nowait()(now)
        except Empty:
            return

    def _hear(self, now: float) -> None:
        try:
            while True:
                frames = self._socket.recv_multipart(zmq.NOBLOCK)
                self._core.receive(frames[-1], now)
        except zmq.Again:
            return

    def _speak(self, now: float) -> None:
        try:
            for frame in self._core.frames(now):
                self._socket.send(frame, zmq.NOBLOCK)
                self._core.sent(frame, now)
        except zmq.Again:
            return

    def _fail(self) -> None:
        self._obey(time.monotonic())
        self._core.fail(f"The link to {self._uri} is closed.")

    # --- sockets ----------------------------------------------------------------------------------

    def _connected(self) -> zmq.Socket[bytes]:
        # IMMEDIATE: nothing queues for a robot that is not there.
        return connected(self._context, zmq.DEALER, self._uri, self._keys, {zmq.IMMEDIATE: 1})

    def _dispose(self) -> None:
        self._closed = True
        self._waker.close()
        self._context.destroy(linger=0)
