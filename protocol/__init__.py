"""The protocol between a robot and its clients in bodyschema; ``SPEC.md`` specifies it.

======================= =========================================================================
For                     Use
======================= =========================================================================
controlling a robot     ``RobotClient``: acquire, perform, read, hold, relax, stop, clear, release
listening to a robot    ``TelemetrySubscriber``
serving a robot         ``Server`` around anything that is a ``rules.robot_interface.Robot``
keys and roles          ``security.keys``: ``KeyDirectory``; ``rules.control``: who may do what
nobody answers: why?    ``transport.connection_probe``: ``probe``
trying any robot        ``python -m protocol.conformance URI``: which clauses of SPEC.md hold
what can go wrong       ``errors``: ``RobotError``, ``RobotUnreachableError``,
                        ``RobotRestartedError``, ``KeysError``, and the table ``ERROR_CODES``
messages                ``wire.messages``, ``wire.capabilities``
frames                  ``wire.codec``: ``encode``, ``decode``
states of a robot       ``rules.transitions``: ``TRANSITIONS``
what a reading means    ``wire.readings``: tilt, clearance, touch
======================= =========================================================================

A subpackage imports only from those named after it: ``conformance``, ``transport``, ``sockets``,
``security``, ``rules``, ``wire``, ``system`` (with ``text``).
"""

from protocol.errors import (
    BodyschemaError,
    EndpointError,
    KeysError,
    ProtocolError,
    RobotError,
    RobotRestartedError,
    RobotUnreachableError,
)
from protocol.security.keys import KeyDirectory
from protocol.transport.client import RobotClient
from protocol.transport.server import Server
from protocol.transport.telemetry import TelemetrySubscriber
from protocol.wire.capabilities import Capabilities, Joint, Sensor
from protocol.wire.messages import ObservationReply, Ok, Progress, State, Status, Telemetry

__all__ = [
    "BodyschemaError",
    "Capabilities",
    "EndpointError",
    "Joint",
    "KeyDirectory",
    "KeysError",
    "ObservationReply",
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
