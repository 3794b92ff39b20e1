"""The control socket of a simulated robot, through which faults are injected.

A stream socket, Unix-domain or loopback. Each connection carries one request, one line of JSON::

    {"do": "inject", "fault": "daq.stuck_channel=3@2i+10s"}   as in sim_robot.faults.fault_panel
    {"do": "mend", "fault": "daq.stuck_channel"}              without "fault": all of them
    {"do": "report"}

The answer is a line, too: ``{"ok": true, "report": {…}}``, or ``{"ok": false, "error": "a
sentence"}``. The report lists the faults that are active and waiting, the interactions so far, and
what else the robot has to tell. From a terminal:
``python -m sim_robot.faults.control_socket URI inject daq.absent``.
"""

from __future__ import annotations

import argparse
import json
import os
import selectors
import socket
import stat
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Final

from protocol.errors import BodyschemaError
from protocol.sockets.zmq_sockets import Endpoint, Waker
from protocol.system.process import Closable, kept_from_children
from robot.errors import CommandError
from sim_robot.errors import FaultError
from sim_robot.faults.fault_panel import FaultPanel, FaultSpec

_IPC_PREFIX: Final = "ipc://"
_MAX_REQUEST: Final = 65536  # bytes of a line
_MAX_OPEN: Final = 64  # connections whose request has not come yet
_MAX_ACCEPTED: Final = 16  # connections before those that are open are read
_BACKLOG: Final = 1024  # connections in the kernel's queue; one that it drops comes again after 1 s
_ANSWER_TIMEOUT: Final = 10.0  # s that a client waits for an answer


class FaultSocket(Closable):
    """Serves a fault panel from a thread of its own.

    Args:
        panel: Panel that injects the faults.
        uri: ``ipc://PATH`` or ``tcp://127.0.0.1:PORT``; port ``*`` takes any free one.
        report: Returns what else the report has to tell, as JSON.

    Attributes:
        endpoint: Address at which the panel is served, with the real port.

    Raises:
        FaultError: The address cannot be served, or other computers could reach it.
    """

    def __init__(
        self,
        panel: FaultPanel,
        uri: str,
        *,
        report: Callable[[], Mapping[str, Any]] = dict,
    ):
        self._panel = panel
        self._report = report
        try:
            self._listener, self.endpoint = _listening(uri)
        except OSError as error:
            raise FaultError(f"Cannot serve faults at {uri}: {error.strerror or error}.") from None
        self._waker = Waker()
        self._requests: dict[socket.socket, bytes] = {}  # bytes so far; the oldest connection first
        self._selector = selectors.DefaultSelector()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="faults", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends the thread and closes the socket."""
        self._stopping = True
        self._waker.wake()
        self._thread.join()
        self._waker.close()
        self._listener.close()
        if self.endpoint.startswith(_IPC_PREFIX):
            with suppress(FileNotFoundError):
                os.unlink(self.endpoint.removeprefix(_IPC_PREFIX))

    def _run(self) -> None:
        with self._selector:
            self._selector.register(self._listener, selectors.EVENT_READ)
            self._selector.register(self._waker.fileno(), selectors.EVENT_READ)
            while not self._stopping:
                for key, _ in self._selector.select():
                    if key.fileobj is self._listener:
                        self._accept()
                    elif isinstance(key.fileobj, socket.socket) and key.fileobj in self._requests:
                        self._read(key.fileobj)
            for connection in self._requests:
                connection.close()

    def _accept(self) -> None:
        """Accepts connections; the oldest open ones make room for them."""
        with suppress(OSError):  # there are no more, or whoever connected is gone
            for _ in range(_MAX_ACCEPTED):
                connection, _ = self._listener.accept()
                if len(self._requests) == _MAX_OPEN:
                    self._drop(next(iter(self._requests)))
                connection.setblocking(False)
                self._requests[connection] = b""
                self._selector.register(connection, selectors.EVENT_READ)

    def _read(self, connection: socket.socket) -> None:
        """Reads from a connection; once a whole line has come, answers it and hangs up."""
        try:
            chunk = connection.recv(_MAX_REQUEST)
            self._requests[connection] += chunk
            line, ended, _ = self._requests[connection].partition(b"\n")
            if chunk and not ended and len(line) < _MAX_REQUEST:
                return
            answer = self._answer(line[:_MAX_REQUEST])
            connection.sendall(json.dumps(answer).encode() + b"\n")
        except OSError:
            pass  # it is gone, or does not read
        self._drop(connection)

    def _drop(self, connection: socket.socket) -> None:
        del self._requests[connection]
        self._selector.unregister(connection)
        connection.close()

    def _answer(self, line: bytes) -> dict[str, Any]:
        try:
            self._obey(json.loads(line))
        except (FaultError, CommandError) as error:
            return {"ok": False, "error": str(error)}
        except (ValueError, RecursionError) as error:
            return {"ok": False, "error": f"That is no JSON: {error}."}
        return {"ok": True, "report": self._whole_report()}

    def _obey(self, request: Any) -> None:
        request = request if isinstance(request, dict) else {}
        match request.get("do"), request.get("fault"):
            case "inject", str(fault):
                self._panel.order(FaultSpec.parse(fault))
            case "mend", str() | None as fault:
                self._panel.mend(fault)
            case "report", _:
                return
            case _:
                raise FaultError(
                    'Write {"do": "inject", "fault": "DEVICE.FAULT"}, {"do": "mend"} or '
                    '{"do": "report"}.'
                )

    def _whole_report(self) -> dict[str, Any]:
        return {
            "active": self._panel.active(),
            "waiting": self._panel.waiting(),
            "interactions": self._panel.interactions,
            **self._report(),
        }


class FaultClient:
    """Talks to the control socket of a simulated robot.

    Each method returns the report.

    Args:
        uri: Address of the control socket.

    Raises:
        FaultError: From each method: the request was refused, or nobody answers.
    """

    def __init__(self, uri: str):
        self._uri = uri

    def inject(self, fault: str) -> dict[str, Any]:
        """Injects a fault, written as in ``sim_robot.faults.fault_panel``."""
        return self._ask({"do": "inject", "fault": fault})

    def mend(self, fault: str | None = None) -> dict[str, Any]:
        """Mends a fault, or all of them."""
        return self._ask({"do": "mend"} if fault is None else {"do": "mend", "fault": fault})

    def report(self) -> dict[str, Any]:
        """The active and waiting faults, and the state of the robot."""
        return self._ask({"do": "report"})

    def _ask(self, request: Mapping[str, str]) -> dict[str, Any]:
        family, address = _address(self._uri)
        try:
            with socket.socket(family, socket.SOCK_STREAM) as connection:
                connection.settimeout(_ANSWER_TIMEOUT)
                connection.connect(address)
                with connection.makefile("rwb") as stream:
                    stream.write(json.dumps(request).encode() + b"\n")
                    stream.flush()
                    answer = json.loads(stream.readline())
        except (OSError, ValueError) as error:
            raise FaultError(
                f"No simulated robot answers at {self._uri} ({error}): is its path right?"
            ) from None
        if not answer["ok"]:
            raise FaultError(answer["error"])
        report: dict[str, Any] = answer["report"]
        return report


def _address(uri: str) -> tuple[socket.AddressFamily, Any]:
    """The family and address of a socket on this computer."""
    if uri.startswith(_IPC_PREFIX) and uri != _IPC_PREFIX:
        return socket.AF_UNIX, uri.removeprefix(_IPC_PREFIX)
    endpoint = Endpoint.parse(uri)
    if not endpoint.is_loopback:
        raise FaultError(
            f"Other computers can reach {uri}; write ipc://PATH or tcp://127.0.0.1:PORT."
        )
    return (socket.AF_INET6 if endpoint.is_ipv6 else socket.AF_INET), (endpoint.host, endpoint.port)


def _listening(uri: str) -> tuple[socket.socket, str]:
    """A listening socket, and its address with the real port."""
    family, address = _address(uri)
    if family == socket.AF_UNIX:
        with suppress(FileNotFoundError):
            if stat.S_ISSOCK(os.stat(address).st_mode):  # of a robot that was killed
                os.unlink(address)
    listener = kept_from_children(socket.socket(family, socket.SOCK_STREAM))
    try:
        if family != socket.AF_UNIX:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(_BACKLOG)
        listener.setblocking(False)  # a client may be gone before it is accepted
    except BaseException:
        listener.close()
        raise
    if family == socket.AF_UNIX:
        return listener, uri
    return listener, str(Endpoint(*listener.getsockname()[:2]))


def main(arguments: Sequence[str] | None = None) -> int:
    """Sends one request and prints the report."""
    parser = argparse.ArgumentParser(prog="python -m sim_robot.faults.control_socket")
    parser.add_argument("uri", help="what sim-robotd --control was given")
    actions = parser.add_subparsers(dest="action", required=True)
    actions.add_parser("inject", help="inject a fault").add_argument("fault")
    actions.add_parser("mend", help="mend a fault, or all").add_argument("fault", nargs="?")
    actions.add_parser("report", help="what is broken")
    options = parser.parse_args(arguments)
    client = FaultClient(options.uri)
    try:
        if options.action == "report":
            report = client.report()
        else:
            report = getattr(client, options.action)(options.fault)
    except BodyschemaError as error:
        print(f"sim_robot.faults.control_socket: {error}", file=sys.stderr)
        return 1
    print(json.dumps(report, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
