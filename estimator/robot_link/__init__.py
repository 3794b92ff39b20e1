"""Where readings come from, behind one interface.

======================= ===================================================================
``tcp://HOST:PORT``     a robot daemon, over the wire (``wire``)
``file:READINGS.csv``   readings that a person wrote down (``by_hand``)
``replay:DIR``          the readings of a recorded run (``replay``)
======================= ===================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

from estimator.errors import EstimatorError
from estimator.robot_link.base import RobotLink
from estimator.robot_link.by_hand import open_by_hand
from estimator.robot_link.replay import open_replay
from estimator.robot_link.wire import WireLink
from protocol.capabilities import Capabilities


def open_robot(
    uri: str,
    *,
    driven: Callable[[Capabilities], Collection[int]],
    client_id: str,
    first_id: int,
    keys: Path | None = None,
) -> RobotLink:
    """Reaches a robot, or opens a record of one.

    Args:
        uri: See the module's table.
        driven: Says which motors of a robot the problem drives.
        client_id: The name under which requests reach the robot.
        first_id: The first request id that this connection may use.
        keys: The key directory, where the robot asks for keys.

    Raises:
        EstimatorError: The URI is of no known kind, or the record cannot be read.
        BodyschemaError: The robot cannot be reached.
    """
    scheme, _, rest = uri.partition(":")
    if scheme == "file" and rest:
        return open_by_hand(Path(rest), driven)
    if scheme == "replay" and rest:
        return open_replay(Path(rest))
    if scheme in ("tcp", "ipc") and rest.startswith("//"):
        return WireLink(uri, client_id=client_id, first_id=first_id, keys=keys)
    raise EstimatorError(
        f"{uri!r} names no robot: write tcp://HOST:PORT, file:READINGS.csv or replay:DIR."
    )
