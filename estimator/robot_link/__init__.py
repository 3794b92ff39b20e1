"""Where readings come from, behind one interface.

======================= ===================================================================
``tcp://HOST:PORT``     a robot daemon, over the wire (``wire``)
``file:READINGS.csv``   readings that a person wrote down (``by_hand``)
``replay:DIR``          the readings of a recorded run (``replay``)
======================= ===================================================================

``base`` is the interface.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

from estimator.errors import EstimatorError
from estimator.readings.plausibility import implausible_body
from estimator.robot_link.base import RobotLink
from estimator.robot_link.by_hand import open_by_hand
from estimator.robot_link.replay import open_replay
from estimator.robot_link.wire import WireLink
from protocol.wire.capabilities import Capabilities


def open_robot(
    uri: str,
    *,
    driven: Callable[[Capabilities], Collection[int]],
    client_id: str,
    first_id: int,
    keys: Path | None = None,
) -> RobotLink:
    """Connects to a robot, or opens a record of one.

    Args:
        uri: See the module's table.
        driven: Says which motors of a robot the problem drives.
        client_id: The name under which requests reach the robot.
        first_id: The first request id that this connection may use.
        keys: The key directory, where the robot asks for keys.

    Raises:
        EstimatorError: The URI is of no known kind, the record cannot be read, or the robot says of
            its body what no robot can be.
        BodyschemaError: The robot cannot be reached.
    """
    scheme, _, rest = uri.partition(":")
    link: RobotLink
    if scheme == "file" and rest:
        link = open_by_hand(Path(rest), driven)
    elif scheme == "replay" and rest:
        link = open_replay(Path(rest))
    elif scheme in ("tcp", "ipc") and rest.startswith("//"):
        link = WireLink(uri, client_id=client_id, first_id=first_id, keys=keys)
    else:
        raise EstimatorError(
            f"{uri!r} names no robot: write tcp://HOST:PORT, file:READINGS.csv or replay:DIR."
        )
    wrong = implausible_body(link.capabilities)
    if wrong is not None:
        link.close()
        raise EstimatorError(f"The robot at {uri} cannot be: {wrong}. Write metres and kilograms.")
    return link
