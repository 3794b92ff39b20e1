"""What is said of a joint that is not where it was sent: only what its movements have shown."""

from __future__ import annotations

import math

from robot.configuration.joint_calibration import DrivenJoint, JointScale
from robot.control.joint_watch import BLOCKED, JAMMED, SAGGING, STOPPED, JointWatch
from robot.drivers.servos.servo_bus import ServoState

LIMIT = math.radians(90)
SCALE = JointScale(((1, -LIMIT), (4095, LIMIT)))
HIP = DrivenJoint(
    name="hip",
    output=1,
    lower_limit=-LIMIT,
    upper_limit=LIMIT,
    part_radius=0.01,
    counts=range(1, 4096),
    scale=SCALE,
)


class Watched:
    """A hip that is watched; angles in degrees."""

    def __init__(self) -> None:
        self._watch = JointWatch([HIP])

    def moved(self, start: float, target: float, here: float) -> str | None:
        self._watch.begin(_states(start))
        return self.read(target, here)

    def read(self, target: float, here: float) -> str | None:
        off_target = self._watch.off_target({"hip": math.radians(target)}, _states(here))
        return off_target.get("hip")


def _states(degrees: float) -> dict[int, ServoState]:
    return {1: ServoState(position=SCALE.exact(math.radians(degrees)), driven=True)}


def test_a_joint_that_was_never_seen_to_move_is_not_called_jammed() -> None:
    hip = Watched()
    assert hip.read(20, 10) == STOPPED
    assert hip.moved(0, 30, 10) == STOPPED  # to have found it there was no movement either
    assert hip.moved(10, 40, 10) == JAMMED


def test_reading_the_same_pose_again_tells_nothing_new() -> None:
    hip = Watched()
    assert [hip.moved(0, 30, 10), hip.read(30, 10), hip.read(30, 10)] == [STOPPED] * 3
    assert [hip.moved(0, 30, 10), hip.read(30, 10)] == [BLOCKED] * 2
    assert [hip.moved(10, 40, 10), hip.read(40, 10)] == [JAMMED] * 2
    assert hip.read(40, 40) is None
    assert hip.read(40, 25) == SAGGING  # which it had passed


def test_a_joint_may_be_blocked_on_both_sides() -> None:
    hip = Watched()
    kinds = [hip.moved(0, 40 * side, 9 * side) for side in (1, -1, 1, -1)]
    assert kinds == [STOPPED, STOPPED, BLOCKED, BLOCKED]


def test_a_joint_that_stops_elsewhere_or_has_passed_its_stop_sags() -> None:
    hip = Watched()
    assert [hip.moved(0, 40, here) for here in (9, 20)] == [STOPPED, SAGGING]
    hip = Watched()
    assert hip.moved(-40, 10, -15) == STOPPED
    assert hip.moved(0, -30, -30) is None  # its stop is not on that side
    assert hip.moved(-40, 10, -15) == BLOCKED
    assert hip.moved(-40, 10, 10) is None
    assert hip.moved(-40, 10, -15) == SAGGING
