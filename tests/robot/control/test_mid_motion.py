"""What happens to a board, or to the daemon's own time, while joints move: never a leap."""

from __future__ import annotations

import pytest

from protocol.wire.messages import ErrorReply, ObservationReply
from robot.control.interaction import LATENESS
from tests.robot.stepped import Bench, program

ALL = {
    f"{part}_{side}": angle
    for part, angle in (("hip", 60.0), ("knee", -70.0))
    for side in ("left", "front", "right", "back")
}
HALF_WAY = 0.9  # s after the start: 0.1 s asking the board, 0.3 s settling at zero, then it moves


def longest_step(bench: Bench) -> list[float]:
    """Keeps the longest move that the board was told to make, rad; replaced as it grows."""
    scales = {joint.output: joint.scale for joint in bench.robot.config.joints}
    longest = [0.0]

    def moved(servo: int, before: int, after: int) -> None:
        way = abs(scales[servo].angle(after) - scales[servo].angle(before))
        longest[0] = max(longest[0], way)

    bench.robot.servo_board.watch_moves(moved)
    return longest


def one_update(bench: Bench) -> float:
    """What a joint may move in one update, rad."""
    return bench.robot.config.speed * LATENESS * bench.robot.servos.seconds_for(8)


@pytest.mark.parametrize("moving", [8, 1])
def test_a_reset_in_mid_motion_leaves_the_joints_where_it_threw_them(
    bench: Bench, moving: int
) -> None:
    bench.perform()
    longest = longest_step(bench)
    bench.clock.freeze()
    motion = bench.submit(program(bench.robot, **dict(list(ALL.items())[:moving])))
    bench.clock.advance_to(bench.clock.now() + HALF_WAY)
    assert bench.state() == "moving"
    bench.pulses()
    bench.robot.servo_board.power_cycle()
    neutral = bench.robot.servo_board.pulses()
    bench.clock.free()
    end = bench.end_of(motion)
    assert isinstance(end, ErrorReply)
    assert end.code == "fault"
    assert "reset" in end.message
    assert bench.pulses() == neutral
    assert bench.state() == "fault"
    assert 0 < longest[0] <= one_update(bench)


@pytest.mark.parametrize("stall", [0.4, 1.0, 1.9])
def test_a_process_that_stood_still_goes_on_with_an_ordinary_step(
    bench: Bench, stall: float
) -> None:
    bench.perform()
    longest = longest_step(bench)
    bench.clock.freeze()
    motion = bench.submit(program(bench.robot, **ALL))
    bench.clock.advance_to(bench.clock.now() + HALF_WAY)
    assert bench.state() == "moving"
    bench.clock.charge(stall)
    bench.clock.free()
    assert isinstance(bench.end_of(motion), ObservationReply)
    assert 0 < longest[0] <= one_update(bench)
