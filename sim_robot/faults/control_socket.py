"""The control socket of a simulated robot: who can reach it can make things fail.

A ZeroMQ REP socket, Unix-domain or loopback. Each request is one JSON object in one frame::

    {"do": "inject", "fault": "daq.stuck_channel=3@2i+10s"}   as in sim_robot.faults.fault_panel
    {"do": "mend", "fault": "daq.stuck_channel"}              without "fault": all of them
    {"do": "report"}

The answer is ``{"ok": true, "report": {…}}``, or ``{"ok": false, "error": "a sentence"}``. The
report lists the faults that are active and waiting, the interactions so far, and what else the
robot has to tell. From a terminal: ``python -m sim_robot.faults.control_socket URI inject
daq.absent``.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import zmq

from protocol.errors import BodyschemaError
from protocol.sockets.closable import Closing
from protocol.sockets.endpoints import Endpoint
from protocol.sockets.waker import Waker
from robot.errors import CommandError
from sim_robot.errors import FaultError
from sim_robot.faults.fault_panel import FaultPanel, FaultSpec

_MAX_REQUEST: Final = 65536
_PATIENCE: Final = 10.0  # s that a client waits for an answer


class FaultSocket(Closing):
    """Serves a fault panel from a thread of its own.

    Args:
        panel: Where faults are injected.
        uri: ``ipc://PATH`` or ``tcp://127.0.0.1:PORT``; port ``*`` takes any free one.
        report: What else there is to tell, as JSON.

    Attributes:
        endpoint: Where it is served, with the real port.

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
        _check_local(uri)
        self._panel = panel
        self._report = report
        self._waker = Waker()
        self._stopping = False
        self._context = zmq.Context()
        self._socket: zmq.Socket[bytes] = self._context.socket(zmq.REP)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.MAXMSGSIZE, _MAX_REQUEST)
        try:
            self._socket.bind(uri)
        except zmq.ZMQError as error:
            self._dispose()
            raise FaultError(f"Cannot serve faults at {uri}: {error.strerror}.") from None
        self.endpoint = self._socket.getsockopt_string(zmq.LAST_ENDPOINT)
        self._thread = threading.Thread(target=self._run, name="faults", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends the thread and closes the socket."""
        self._stopping = True
        self._waker.wake()
        self._thread.join()
        self._dispose()

    def _run(self) -> None:
        poller = zmq.Poller()
        poller.register(self._socket, zmq.POLLIN)
        poller.register(self._waker.fileno(), zmq.POLLIN)
        while True:
            ready = dict(poller.poll())
            if self._stopping:
                return
            if self._socket in ready:
                self._socket.send(json.dumps(self._answer(self._socket.recv())).encode())

    def _answer(self, frame: bytes) -> dict[str, Any]:
        try:
            self._obey(json.loads(frame))
        except (FaultError, CommandError) as error:
            return {"ok": False, "error": str(error)}
        except ValueError as error:
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

    def _dispose(self) -> None:
        self._context.destroy(linger=0)
        self._waker.close()


class FaultClient(Closing):
    """Talks to the control socket of a simulated robot.

    Each method returns the report.

    Args:
        uri: Where the control socket is.

    Raises:
        FaultError: From each method: the request was refused, or nobody answers.
    """

    def __init__(self, uri: str):
        self._uri = uri
        self._context = zmq.Context()

    def inject(self, fault: str) -> dict[str, Any]:
        """Injects a fault, written as in ``sim_robot.faults.fault_panel``."""
        return self._ask({"do": "inject", "fault": fault})

    def mend(self, fault: str | None = None) -> dict[str, Any]:
        """Mends a fault, or all of them."""
        return self._ask({"do": "mend"} if fault is None else {"do": "mend", "fault": fault})

    def report(self) -> dict[str, Any]:
        """What is broken, and how the robot fares."""
        return self._ask({"do": "report"})

    def close(self) -> None:
        """Closes the connection."""
        self._context.destroy(linger=0)

    def _ask(self, request: Mapping[str, str]) -> dict[str, Any]:
        with self._context.socket(zmq.REQ) as wire:
            wire.setsockopt(zmq.LINGER, 0)
            wire.connect(self._uri)
            wire.send(json.dumps(request).encode())
            if not wire.poll(round(_PATIENCE * 1000)):
                raise FaultError(f"No simulated robot answers at {self._uri}: is its path right?")
            answer = json.loads(wire.recv())
        if not answer["ok"]:
            raise FaultError(answer["error"])
        report: dict[str, Any] = answer["report"]
        return report


def _check_local(uri: str) -> None:
    if uri.startswith("ipc://") and len(uri) > len("ipc://"):
        return
    if not Endpoint.parse(uri).is_loopback:
        raise FaultError(
            f"Other computers can reach {uri}; write ipc://PATH or tcp://127.0.0.1:PORT."
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Sends one request and prints the report."""
    parser = argparse.ArgumentParser(prog="python -m sim_robot.faults.control_socket")
    parser.add_argument("uri", help="what sim-robotd --control was given")
    actions = parser.add_subparsers(dest="action", required=True)
    actions.add_parser("inject", help="inject a fault").add_argument("fault")
    actions.add_parser("mend", help="mend a fault, or all").add_argument("fault", nargs="?")
    actions.add_parser("report", help="what is broken")
    options = parser.parse_args(arguments)
    try:
        with FaultClient(options.uri) as client:
            if options.action == "report":
                found = client.report()
            else:
                found = getattr(client, options.action)(options.fault)
    except BodyschemaError as error:
        print(f"sim_robot.faults.control_socket: {error}", file=sys.stderr)
        return 1
    print(json.dumps(found, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
