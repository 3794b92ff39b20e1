"""The wire between a robot and its controllers. ``SPEC.md`` in this folder describes it in words.

======================= =========================================================================
For                     Use
======================= =========================================================================
controlling a robot     ``RobotClient``: acquire, perform, read, hold, relax, stop, clear, release
listening to a robot    ``TelemetrySubscriber``
serving a robot         ``Server`` around anything that is a ``protocol.robot.Robot``
keys and roles          ``protocol.keys``: ``KeyDirectory``; ``protocol.roles``: who may do what
nobody answers: why?    ``protocol.probe``: ``probe``
trying any robot        ``python -m protocol.conformance URI``: which clauses of the page hold
what can go wrong       ``protocol.errors``: ``RobotError``, ``RobotUnreachableError``,
                        ``RobotRestartedError``, ``KeysError``, and the table ``ERROR_CODES``
messages                ``protocol.messages``, ``protocol.capabilities``
frames                  ``protocol.codec``: ``encode``, ``decode``
states of a robot       ``protocol.transitions``: ``TRANSITIONS``
what a reading means    ``protocol.readings``: tilt, clearance, touch
======================= =========================================================================

The rules live in three modules without sockets, threads or clocks: ``core`` (the server's side),
``dialogue`` (the client's side) and ``outcomes`` (why a robot never moves twice for one request).
"""

from protocol.capabilities import Capabilities, Joint, Sensor
from protocol.client import RobotClient
from protocol.errors import (
    BodyschemaError,
    EndpointError,
    KeysError,
    ProtocolError,
    RobotError,
    RobotRestartedError,
    RobotUnreachableError,
)
from protocol.keys import KeyDirectory
from protocol.messages import Observation, Ok, Progress, Status, Telemetry
from protocol.server import Server
from protocol.states import State
from protocol.telemetry import TelemetrySubscriber

__all__ = [
    "BodyschemaError",
    "Capabilities",
    "EndpointError",
    "Joint",
    "KeyDirectory",
    "KeysError",
    "Observation",
    "Ok",
    "Progress",
    "ProtocolError",
    "RobotClient",
    "RobotError",
    "RobotRestartedError",
    "RobotUnreachableError",
    "Sensor",
    "Server",
    "State",
    "Status",
    "Telemetry",
    "TelemetrySubscriber",
]
