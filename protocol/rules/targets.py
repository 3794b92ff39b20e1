"""Checks targets against a robot's joints, with the same result on both sides of the wire."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import count
from typing import Final

from protocol.errors import RobotError
from protocol.wire.capabilities import Joint

_DECIMALS: Final = 4  # with which an angle is printed, or more, where those hide the difference


def check_targets(joints: Sequence[Joint], targets: Mapping[str, float]) -> None:
    """Checks that the targets name every joint once and lie within the limits, which are reachable.

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
        if not joint.lower <= target <= joint.upper:
            limit = joint.lower if target < joint.lower else joint.upper
            digits = next(n for n in count(_DECIMALS) if _differ(target, limit, n))
            raise RobotError(
                "out_of_range",
                f"Joint {joint.name} reaches {joint.lower:.{digits}f} to {joint.upper:.{digits}f} "
                f"rad, not {target:.{digits}f}.",
            )


def _differ(one: float, other: float, digits: int) -> bool:
    return f"{one:.{digits}f}" != f"{other:.{digits}f}"


def _list(names: Sequence[str]) -> str:
    shown = ", ".join(names[:8])
    return shown if len(names) <= 8 else f"{shown} and {len(names) - 8} more"
