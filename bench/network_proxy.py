"""Bad networks between a client and a robot, for tests.

``MessageProxy`` stands between DEALERs and a ROUTER and loses, doubles, delays and reorders whole
messages, as a broken relay or a client's reconnections can. ``TcpProxy`` stands in the byte stream
and cuts it, as a pulled cable or a reset router does: TCP itself hides lost and reordered packets.
"""

from __future__ import annotations

import heapq
import itertools
import math
import os
import random
import selectors
import socket
import threading
import time
from abc import abstractmethod
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import zmq

from protocol.sockets.zmq_sockets import Endpoint, Waker
from protocol.system.process import Closable

_PORTS: Final = itertools.count(20_000 + 2 * (os.getpid() % 5000), 2)
_MOST_CLIENTS: Final = 256  # connections that are kept; reconnecting makes ever new ones
_CHUNK: Final = 65536


def lasting_port() -> int:
    """A free TCP port, with a free one after it, that can be bound again after its owner has died.

    The kernel hands higher ports out to whoever connects somewhere: even to a client that tries to
    reach this very port, which then talks to itself.
    """
    while True:
        port = 20_000 + next(_PORTS) % 12_000
        try:
            for number in (port, port + 1):
                socket.create_server(("127.0.0.1", number)).close()
        except OSError:
            continue
        return port


class _Service(Closable):
    """A thread that polls until it is asked to end."""

    def __init__(self) -> None:
        self._waker = Waker()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name=type(self).__name__, daemon=True)

    def close(self) -> None:
        """Ends the thread and closes every connection."""
        self._stopping = True
        self._waker.wake()
        self._thread.join()
        self._dispose()
        self._waker.close()

    @abstractmethod
    def _run(self) -> None: ...

    @abstractmethod
    def _dispose(self) -> None: ...


@dataclass(frozen=True, kw_only=True)
class Weather:
    """What happens to each message, in either direction.

    Attributes:
        loss: Share of messages that vanish.
        duplication: Share of messages that come twice.
        delay: Shortest time that each message takes, s.
        jitter: Longest time that it may take on top, s, drawn for each message: their order
            changes.
    """

    loss: float = 0.0
    duplication: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0


@dataclass(kw_only=True)
class Fates:
    """Numbers of messages that a proxy passed on, lost, doubled, and that a later one overtook."""

    passed: int = 0
    lost: int = 0
    doubled: int = 0
    overtaken: int = 0


class MessageProxy(_Service):
    """A relay of ZeroMQ messages to one robot.

    Args:
        target: Address of the robot.
        weather: What happens to messages.
        seed: Seed of what is drawn for messages.

    Attributes:
        endpoint: Address where clients connect instead.
        weather: What happens to messages; may be replaced at any time.
        fates: What became of messages so far.
    """

    def __init__(self, target: str, weather: Weather | None = None, *, seed: int = 0):
        super().__init__()
        self.weather = weather or Weather()
        self.fates = Fates()
        self._target = target
        self._random = random.Random(seed)
        self._order = itertools.count()
        self._latest: dict[tuple[bytes, bool], int] = {}
        # (when, in which order it came, whose, whether to the robot, the message)
        self._under_way: list[tuple[float, int, bytes, bool, bytes]] = []
        self._context = zmq.Context()
        self._front: zmq.Socket[bytes] = self._context.socket(zmq.ROUTER)
        self._front.setsockopt(zmq.LINGER, 0)
        self._front.bind("tcp://127.0.0.1:*")
        self._backs: OrderedDict[bytes, zmq.Socket[bytes]] = OrderedDict()
        self.endpoint = self._front.getsockopt_string(zmq.LAST_ENDPOINT)
        self._thread.start()

    def _run(self) -> None:
        while not self._stopping:
            poller = zmq.Poller()
            poller.register(self._waker.fileno(), zmq.POLLIN)
            poller.register(self._front, zmq.POLLIN)
            owners = {back: peer for peer, back in self._backs.items()}
            for back in owners:
                poller.register(back, zmq.POLLIN)
            ready = dict(poller.poll(self._patience()))
            self._waker.rest()
            if self._front in ready:
                peer, *frames = self._front.recv_multipart()
                self._back(peer)
                self._send_off(peer, True, frames[-1])
            for back, peer in owners.items():
                if back in ready:
                    self._send_off(peer, False, back.recv_multipart()[-1])
            self._deliver()

    def _back(self, peer: bytes) -> zmq.Socket[bytes]:
        back = self._backs.get(peer)
        if back is None:
            back = self._context.socket(zmq.DEALER)
            back.setsockopt(zmq.LINGER, 0)
            back.connect(self._target)
            self._backs[peer] = back
            if len(self._backs) > _MOST_CLIENTS:
                oldest, idle = self._backs.popitem(last=False)
                idle.close()
                for to_robot in (True, False):
                    self._latest.pop((oldest, to_robot), None)
        self._backs.move_to_end(peer)
        return back

    def _patience(self) -> int | None:
        if not self._under_way:
            return None
        return max(0, math.ceil((self._under_way[0][0] - time.monotonic()) * 1000))

    def _send_off(self, peer: bytes, to_robot: bool, message: bytes) -> None:
        weather, draw = self.weather, self._random.random
        if draw() < weather.loss:
            self.fates.lost += 1
            return
        copies = 1 + (draw() < weather.duplication)
        self.fates.doubled += copies - 1
        for _ in range(copies):
            due = time.monotonic() + weather.delay + draw() * weather.jitter
            item = (due, next(self._order), peer, to_robot, message)
            heapq.heappush(self._under_way, item)

    def _deliver(self) -> None:
        while self._under_way and self._under_way[0][0] <= time.monotonic():
            _, order, peer, to_robot, message = heapq.heappop(self._under_way)
            latest = self._latest.get((peer, to_robot), -1)
            self.fates.overtaken += order < latest
            self._latest[peer, to_robot] = max(order, latest)
            self.fates.passed += 1
            if to_robot:
                self._back(peer).send(message)
            else:
                self._front.send_multipart([peer, message])

    def _dispose(self) -> None:
        self._context.destroy(linger=0)


class TcpProxy(_Service):
    """A relay of bytes to one robot, whose cable can be pulled.

    Args:
        target: Address of the robot, ``tcp://HOST:PORT``.

    Attributes:
        endpoint: Address where clients connect instead.
    """

    def __init__(self, target: str):
        super().__init__()
        self._target = Endpoint.parse(target)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._waker, selectors.EVENT_READ)
        self._actions: list[Callable[[], None]] = []
        self._pairs: dict[socket.socket, socket.socket] = {}
        self._pulled = False
        self._port = lasting_port()
        self._listener = self._listening()
        self.endpoint = f"tcp://127.0.0.1:{self._port}"
        self._thread.start()

    def cut(self) -> None:
        """Resets every connection and takes no new ones, as when the robot's network goes down."""
        self._ask(self._cut)

    def pull(self) -> None:
        """Stops passing bytes on, and tells neither end, as when a cable is out."""
        self._ask(self._pull)

    def mend(self) -> None:
        """Passes bytes on again, those that were under way when the cable was pulled included."""
        self._ask(self._mend)

    def _ask(self, action: Callable[[], None]) -> None:
        done = threading.Event()

        def act() -> None:
            action()
            done.set()

        self._actions.append(act)
        self._waker.wake()
        assert done.wait(10), "the proxy hangs"

    def _run(self) -> None:
        while not self._stopping:
            for key, _ in self._selector.select():
                if key.fileobj is self._waker:
                    self._waker.rest()
                elif key.fileobj is self._listener:
                    self._accept()
                elif isinstance(key.fileobj, socket.socket):
                    self._pump(key.fileobj)
            while self._actions:
                self._actions.pop(0)()

    def _listening(self) -> socket.socket:
        listener = socket.create_server(("127.0.0.1", self._port))
        self._selector.register(listener, selectors.EVENT_READ)
        return listener

    def _accept(self) -> None:
        near, _ = self._listener.accept()
        try:
            far = socket.create_connection((self._target.host, self._target.port), timeout=5)
        except OSError:
            near.close()
            return
        for end, opposite in ((near, far), (far, near)):
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._pairs[end] = opposite
            if not self._pulled:
                self._selector.register(end, selectors.EVENT_READ)

    def _pump(self, source: socket.socket) -> None:
        if source not in self._pairs:  # its other end was closed first
            return
        try:
            data = source.recv(_CHUNK)
            if data:
                self._pairs[source].sendall(data)
                return
        except OSError:
            data = b""
        opposite = self._pairs.pop(source)
        del self._pairs[opposite]
        for end in (source, opposite):
            self._forget(end)
            end.close()

    def _forget(self, end: socket.socket) -> None:
        if end in self._selector.get_map():
            self._selector.unregister(end)

    def _cut(self) -> None:
        reset = b"\x01\x00\x00\x00\x00\x00\x00\x00"  # linger for no time at all
        for end in self._pairs:
            self._forget(end)
            end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, reset)
            end.close()
        self._pairs.clear()
        if self._listener.fileno() >= 0:
            self._forget(self._listener)
            self._listener.close()

    def _pull(self) -> None:
        self._pulled = True
        for end in self._pairs:
            self._forget(end)

    def _mend(self) -> None:
        self._pulled = False
        for end in self._pairs:
            self._forget(end)
            self._selector.register(end, selectors.EVENT_READ)
        if self._listener.fileno() < 0:
            self._listener = self._listening()

    def _dispose(self) -> None:
        self._cut()
        self._selector.close()
