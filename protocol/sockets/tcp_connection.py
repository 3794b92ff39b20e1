"""One TCP connection, and the ZeroMQ socket that serves this connection alone.

Bytes go from TCP through a Unix-domain socket into ZeroMQ, and back. So every peer has a ZeroMQ
socket to itself: an identity that it claims cannot collide with another's, and its bytes are
counted before they reach ZeroMQ, which has no limit for a message of many parts.
"""

from __future__ import annotations

import selectors
import socket
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Final, TypeAlias

import zmq

_CHUNK: Final = 8192  # most bytes forwarded to the peer in one turn
FRAME_COST: Final = 64
"""Bytes of memory that ZeroMQ takes for a frame besides its content, however short that is."""

Callback: TypeAlias = Callable[["TcpConnection"], None]


class TcpConnection:
    """A TCP connection to one peer; only the thread that polls the selector may use it.

    Args:
        number: Name of the connection, which no other has or had.
        peer: Address of the peer, to be shown to people.
        selector: Selector at which the sockets register; its owner calls the registered callbacks.
        tcp: TCP socket, accepted.
        pipe: Near end of the Unix-domain socket.
        wire: ZeroMQ socket at the far end of the Unix-domain socket.
        chunk: Most bytes from the peer that one turn takes.
        on_signal: Called when ``receive`` may have a message, or the connection has ended.
        on_bytes: Called when ``held`` has grown.

    Attributes:
        number: As given; ``peer``, too.
        user: Public key that it was made with, in Z85, once a message has shown that.
        proven: Whether a message has come; with keys, its sender is then known.
        heard: Time of the last message, at first of acceptance, monotonic, s.
        held: Bytes that ZeroMQ may hold: all since the last message, and the cost of frames.
        received: Bytes of all messages received so far.
        waiting: Whether the owner has yet to call ``receive``; nothing more is read until then.
        ended: Whether no more will come: ``receive`` returns what is left, then always ``None``.
        closed: Whether ``close`` was called.
    """

    def __init__(
        self,
        number: bytes,
        peer: str,
        selector: selectors.BaseSelector,
        *,
        tcp: socket.socket,
        pipe: socket.socket,
        wire: zmq.Socket[bytes],
        chunk: int,
        on_signal: Callback,
        on_bytes: Callback,
    ):
        self.number = number
        self.peer = peer
        self.user: str | None = None
        self.proven = False
        self.heard = time.monotonic()
        self.held = 0
        self.received = 0
        self.waiting = False
        self.ended = False
        self.closed = False
        self._selector = selector
        self._tcp = tcp
        self._pipe = pipe
        self._wire = wire
        self._is_router = wire.type == zmq.ROUTER
        self._chunk = chunk
        self._on_signal = on_signal
        self._on_bytes = on_bytes
        self._identity: list[bytes] = []  # what a ROUTER calls its only peer
        self._frames = FrameCounter()
        self._up = b""  # on its way to ZeroMQ
        self._down = b""  # on its way to the peer
        self._hung_up = False  # by the peer
        self._watched: dict[socket.socket, int] = {}
        tcp.setblocking(False)
        pipe.setblocking(False)
        self._signal = int(wire.getsockopt(zmq.FD))
        selector.register(self._signal, selectors.EVENT_READ, self._signalled)
        self._watch()

    def receive(self) -> Sequence[zmq.Frame] | None:
        """Returns the parts of the next message; ``None``: there is none now."""
        if self.closed:
            return None
        try:
            parts = self._wire.recv_multipart(zmq.NOBLOCK, copy=False)
        except zmq.Again:
            return None
        self.proven = True
        self.heard = time.monotonic()
        self.held = 0
        if self._is_router:
            self._identity = [parts.pop(0).bytes]
        self.received += sum(map(len, parts))
        return parts

    def send(self, parts: Sequence[bytes]) -> None:
        """Sends a message; drops it where the peer does not read."""
        if self.closed:
            return
        with suppress(zmq.Again):  # the peer will ask again
            self._wire.send_multipart([*self._identity, *parts], zmq.NOBLOCK)
        self._on_signal(self)  # sending may have used up the signal of a message that came

    def close(self, linger: int = 0) -> None:
        """Closes the connection; with a linger, ms, ``flush`` has to be called next."""
        if self.closed:
            return
        self.closed = True
        self._selector.unregister(self._signal)
        self._watch()
        self._wire.close(linger)
        if not linger:
            self._pipe.close()
            self._tcp.close()

    def flush(self, seconds: float) -> None:
        """Forwards what ZeroMQ still sends, waiting at most ``seconds`` at a time, and closes."""
        with self._pipe, self._tcp:
            try:
                for end in (self._pipe, self._tcp):
                    end.settimeout(seconds)
                self._tcp.sendall(self._down)
                while chunk := self._pipe.recv(_CHUNK):
                    self._tcp.sendall(chunk)
            except OSError:
                return  # too late, or nobody is there any more

    # --- bytes ------------------------------------------------------------------------------------

    def _signalled(self, mask: int) -> None:
        del mask
        if not self.closed:
            self._on_signal(self)

    def _on_tcp(self, mask: int) -> None:
        if self.closed or self._hung_up:
            return
        if mask & selectors.EVENT_WRITE:
            self._hand_down()
        if mask & selectors.EVENT_READ and not (self.waiting or self._hung_up):
            try:
                self._take(self._tcp.recv(self._chunk))
            except BlockingIOError:
                pass
            except OSError:  # reset
                self._hang_up()
        self._watch()

    def _on_pipe(self, mask: int) -> None:
        if self.closed or self.ended:
            return
        if mask & selectors.EVENT_WRITE:
            self._hand_up()
        if mask & selectors.EVENT_READ and not self.ended:
            try:
                self._give(self._pipe.recv(_CHUNK))
            except BlockingIOError:
                pass
            except OSError:  # ZeroMQ closed its end with something unread
                self._end()
        self._watch()

    def _take(self, chunk: bytes) -> None:
        """Handles bytes from the peer."""
        if not chunk:
            self._hang_up()
            return
        try:
            frames = self._frames.count(chunk)
        except ValueError:
            self._end()
            return
        self.held += len(chunk) + FRAME_COST * frames
        self._up = chunk
        self._hand_up()
        self._on_bytes(self)

    def _hand_up(self) -> None:
        try:
            self._up = self._up[self._pipe.send(self._up) :]
        except BlockingIOError:
            return
        except OSError:
            self._end()
            return
        if self._hung_up and not self._up:
            self._shut()

    def _give(self, chunk: bytes) -> None:
        """Handles bytes from ZeroMQ."""
        if not chunk:
            self._end()
            return
        if not self._hung_up:
            self._down = chunk
            self._hand_down()

    def _hand_down(self) -> None:
        try:
            self._down = self._down[self._tcp.send(self._down) :]
        except BlockingIOError:
            return
        except OSError:  # reset
            self._hang_up()

    def _hang_up(self) -> None:
        """Handles the end of the peer's stream; what it has sent is still delivered."""
        self._hung_up = True
        self._down = b""
        if not self._up:
            self._shut()

    def _shut(self) -> None:
        """Tells ZeroMQ that the peer sends nothing more."""
        with suppress(OSError):  # ZeroMQ has closed its end
            self._pipe.shutdown(socket.SHUT_WR)

    def _end(self) -> None:
        """Handles the end of ZeroMQ's side."""
        self.ended = True
        self._on_signal(self)

    def _watch(self) -> None:
        """Registers the events that each socket waits for."""
        read, write = selectors.EVENT_READ, selectors.EVENT_WRITE
        tcp = pipe = 0
        if not (self.closed or self.ended):
            pipe = (0 if self._down else read) | (write if self._up else 0)
            if not self._hung_up:
                tcp = (0 if self._up else read) | (write if self._down else 0)
        self._watch_one(self._tcp, tcp, self._on_tcp)
        self._watch_one(self._pipe, pipe, self._on_pipe)

    def _watch_one(self, end: socket.socket, mask: int, call: Callable[[int], None]) -> None:
        old_mask = self._watched.get(end, 0)
        self._watched[end] = mask
        if mask == old_mask:
            return
        if not mask:
            self._selector.unregister(end)
        elif not old_mask:
            self._selector.register(end, mask, call)
        else:
            self._selector.modify(end, mask, call)


_GREETING: Final = 64  # bytes
_SIGNATURE: Final = 10  # bytes, then comes the major version
_VERSION: Final = 3
_WIDE: Final = 2  # flag: the size takes 8 bytes instead of 1


class FrameCounter:
    """Counts frames as their bytes come: messages and commands, encrypted ones, too.

    The framing is that of ZMTP 3, RFC 23: a greeting; then frames of flags, size and body. CURVE
    encrypts bodies only.
    """

    def __init__(self) -> None:
        self._greeted = False
        self._partial = b""  # of a greeting or of a frame's head that is incomplete
        self._skip = 0  # bytes of a body that are still to come

    def count(self, data: bytes) -> int:
        """Returns how many frames begin in the next bytes of the stream.

        Raises:
            ValueError: The peer does not speak ZMTP 3.
        """
        data = self._partial + data
        offset = self._skip
        if not self._greeted:
            _check_greeting(data)
            if len(data) < _GREETING:
                self._partial = data
                return 0
            self._greeted = True
            offset = _GREETING
        frames = 0
        end = len(data)
        while offset < end:
            body = offset + (9 if data[offset] & _WIDE else 2)
            if body > end:
                break
            offset = body + int.from_bytes(data[offset + 1 : body], "big")
            frames += 1
        self._partial = data[offset:]
        self._skip = max(0, offset - end)
        return frames


def _check_greeting(begun: bytes) -> None:
    if begun and begun[0] != 0xFF:
        raise ValueError("no ZMTP signature")
    if len(begun) >= _SIGNATURE and begun[_SIGNATURE - 1] != 0x7F:
        raise ValueError("no ZMTP signature")
    if len(begun) > _SIGNATURE and begun[_SIGNATURE] < _VERSION:
        raise ValueError(f"ZMTP {begun[_SIGNATURE]} instead of 3")
