"""A wire tap: passes TCP connections on, and keeps what the client sent."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress

from protocol.sockets.zmq_sockets import Endpoint


class Tap:
    """Stands between clients and a server; ``inject`` adds bytes of our own to a live connection.

    Attributes:
        endpoint: Where clients connect.
        recorded: What clients sent so far, for each connection, piece by piece.
    """

    def __init__(self, target: str):
        place = Endpoint.parse(target)
        self._target = (place.host, place.port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"
        self.recorded: list[list[bytes]] = []
        self._streams: list[socket.socket] = [self._listener]
        self._upward: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept)]
        self._threads[0].start()

    def inject(self, data: bytes) -> None:
        """Sends bytes to the server on the newest connection, as if the client had."""
        self._upward[-1].sendall(data)

    def close(self) -> None:
        for stream in self._streams:
            with suppress(OSError):
                stream.shutdown(socket.SHUT_RDWR)
            stream.close()
        for thread in self._threads:
            thread.join()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
                far = socket.create_connection(self._target)
            except OSError:
                return
            self._streams += [near, far]
            self._upward.append(far)
            self.recorded.append([])
            for source, sink, kept in ((near, far, self.recorded[-1]), (far, near, None)):
                thread = threading.Thread(target=self._pass_on, args=(source, sink, kept))
                self._threads.append(thread)
                thread.start()

    @staticmethod
    def _pass_on(source: socket.socket, sink: socket.socket, kept: list[bytes] | None) -> None:
        with suppress(OSError):
            while data := source.recv(65_536):
                if kept is not None:
                    kept.append(data)
                sink.sendall(data)
        with suppress(OSError):
            sink.shutdown(socket.SHUT_WR)
