"""The protocol between a robot and its clients, which ``SPEC.md`` in this folder specifies.

A client uses ``RobotClient`` and ``TelemetrySubscriber``; a robot, ``Server`` around a
``rules.robot_interface.Robot``. ``python -m protocol.conformance URI`` tries any robot against the
specification.
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
from protocol.wire.messages import ObservationReply, Ok, Progress, Status, Telemetry
from protocol.wire.states import State

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
