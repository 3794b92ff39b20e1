"""Are these targets for that robot? The same answer on both sides of the wire."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from protocol.capabilities import Joint
from protocol.errors import RobotError

ROUNDING: Final = 1e-9
"""How far beyond a limit still counts as the limit, rad: degrees do not convert exactly."""


def check_targets(joints: Sequence[Joint], targets: Mapping[str, float]) -> None:
    """Checks that the targets name every joint once and lie within the limits.

    Args:
        joints: The joints that ``hello`` lists.
        targets: Target angle by joint name, rad.

    Raises:
        RobotError: ``bad_targets`` or ``out_of_range``; the sentence names the joint.
    """
    names = [joint.name for joint in joints]
    missing = [name for name in names if name not in targets]
    unknown = [name for name in targets if name not in names]
    if missing:
        raise RobotError("bad_targets", f"There is no target for {_list(missing)}.")
    if unknown:
        raise RobotError("bad_targets", f"There is no joint {_list(unknown)}.")
    for joint in joints:
        target = targets[joint.name]
        if not joint.lower - ROUNDING <= target <= joint.upper + ROUNDING:
            raise RobotError(
                "out_of_range",
                f"Joint {joint.name} reaches {joint.lower:.4f} to {joint.upper:.4f} rad, "
                f"not {target:.4f}.",
            )


def _list(names: Sequence[str]) -> str:
    shown = ", ".join(names[:8])
    return shown if len(names) <= 8 else f"{shown} and {len(names) - 8} more"
