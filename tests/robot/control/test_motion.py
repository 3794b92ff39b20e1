"""Slewing: never too fast, always arriving, no servo forgotten."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from robot.configuration.joint_calibration import DrivenJoint, JointScale
from robot.control.motion import Slew
from robot.drivers.servos.sv203 import COUNTS

SPEED = math.radians(60)
NUMBERS = st.integers(1, 255)


def joints(number: int) -> list[DrivenJoint]:
    return [
        DrivenJoint(
            name=f"joint{output}",
            output=output,
            lower_limit=-2.0,
            upper_limit=2.0,
            part_radius=0.01,
            counts=COUNTS,
            scale=JointScale(((1, -1.6), (255, 1.6 if output % 2 else 1.2))),
        )
        for output in range(1, number + 1)
    ]


@given(
    st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=8),
    st.lists(st.floats(0.001, 0.3), min_size=1, max_size=5),
)
def test_every_joint_arrives_and_none_is_faster_than_its_servo(
    ways: list[tuple[int, int]], pauses: list[float]
) -> None:
    driven = joints(len(ways))
    start = {joint.output: way[0] for joint, way in zip(driven, ways, strict=True)}
    targets = {joint.output: way[1] for joint, way in zip(driven, ways, strict=True)}
    slew = Slew(driven, start=start, targets=targets, speed=SPEED, period=1.0, now=0.0)
    counts, updated, now = dict(start), dict.fromkeys(start, 0.0), 0.0
    rounds = 0
    while not slew.arrived:
        due = slew.due(now, at_most=2)
        assert len(due) <= 2
        for output, count in due.items():
            scale = driven[output - 1].scale
            moved = abs(scale.angle(count) - scale.angle(counts[output]))
            assert moved <= SPEED * (now - updated[output]) + 1e-9
            counts[output], updated[output] = count, now
        slew.sent(due, now)
        assert 0.0 <= slew.fraction <= 1.0
        now += pauses[rounds % len(pauses)]
        rounds += 1
        # The longest way takes 3.2 rad / 60°/s at most; waiting for a free line adds to it.
        assert now < 60, "does not arrive"
    assert counts == targets


def test_joints_do_not_finish_together() -> None:
    driven = joints(2)
    slew = Slew(
        driven, start={1: 128, 2: 128}, targets={1: 130, 2: 200}, speed=SPEED, period=1.0, now=0.0
    )
    first = slew.due(0.1, at_most=2)
    assert first[1] == 130
    assert 128 < first[2] < 200


@given(st.floats(0.1, 1e4), st.floats(math.radians(1), SPEED), st.floats(0.01, 0.3))
def test_a_delay_never_ends_in_a_leap(delay: float, speed: float, period: float) -> None:
    driven = joints(1)
    slew = Slew(driven, start={1: 10}, targets={1: 250}, speed=speed, period=period, now=0.0)
    scale = driven[0].scale
    count = slew.due(delay, at_most=2).get(1, 10)
    assert scale.angle(count) - scale.angle(10) <= max(period * speed, scale.resolution) + 1e-9
    slew.sent({1: count}, delay)
    # … and the time that was lost is not made up for.
    further = slew.due(delay + period, at_most=2).get(1, count)
    moved = scale.angle(further) - scale.angle(count)
    assert moved <= max(period * speed, scale.resolution) + 1e-9


def test_the_slowest_joint_arrives() -> None:
    driven = joints(1)
    slew = Slew(driven, start={1: 10}, targets={1: 13}, speed=math.radians(1), period=0.1, now=0.0)
    now = 0.0
    while not slew.arrived:
        now += 0.05
        slew.sent(slew.due(now, at_most=2), now)
        assert now < 10  # three counts of 0.7°
