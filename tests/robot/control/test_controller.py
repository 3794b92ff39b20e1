"""The control loop on still electronics: motions, interrupts, faults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import pytest

from protocol.errors import RobotError
from protocol.rules.robot_interface import Progressed
from protocol.wire.messages import (
    Clear,
    ErrorReply,
    Hold,
    ObservationReply,
    Perform,
    Read,
    Relax,
    Stop,
)
from tests.robot.stepped import Bench, hip, program, request, shake

SPEED = 60.0  # degrees per second


def test_a_motion_ends_at_the_nearest_counts(bench: Bench) -> None:
    seen = bench.perform(hip_left=-20.0, knee_back=10.0)
    assert math.degrees(seen.angles["hip_left"]) == pytest.approx(-20.0, abs=0.68 / 2)
    assert math.degrees(seen.angles["knee_back"]) == pytest.approx(10.0, abs=0.76 / 2)
    assert hip(bench) == pytest.approx(math.degrees(seen.angles["hip_left"]))
    assert seen.settled
    assert seen.tilt == pytest.approx((0.0, 0.0), abs=1e-3)
    assert seen.clearance == pytest.approx(0.0, abs=1e-3)
    assert seen.touch == (False,) * 4
    assert bench.state() == "holding"


def test_no_joint_is_faster_than_its_servo(bench: Bench) -> None:
    bench.perform()
    bench.clock.freeze()
    start = bench.clock.now()
    ticket = bench.submit(program(bench.robot, hip_left=30.0))
    while bench.state() != "settling" or hip(bench) < 1:
        bench.clock.advance_to(bench.clock.now() + 0.02)
        # One count of 0.68° may be the rounding of the start.
        assert hip(bench) <= SPEED * (bench.clock.now() - start) + 0.68
    bench.clock.free()
    assert isinstance(bench.end_of(ticket), ObservationReply)


def test_progress_runs_through_its_phases_in_order(bench: Bench) -> None:
    bench.perform(hip_left=30.0)
    phases = [event.phase for event in bench.events if isinstance(event, Progressed)]
    assert list(dict.fromkeys(phases)) == ["homing", "settling", "moving", "sampling"]
    assert all(0 <= e.fraction <= 1 for e in bench.events if isinstance(e, Progressed))


@pytest.mark.parametrize(
    ("kind", "code", "state"),
    [(Stop, "aborted_stop", "stopped"), (Hold, "aborted_hold", "holding")],
)
def test_an_interrupt_freezes_the_motion_where_it_is(
    bench: Bench, kind: type[Stop | Hold], code: str, state: str
) -> None:
    bench.perform()
    bench.clock.freeze()
    start = bench.clock.now()
    motion = bench.submit(program(bench.robot, hip_left=30.0))
    bench.clock.advance_to(start + 0.75)  # 0.3 s of settling at zero come first
    assert bench.state() == "moving"
    interrupt = bench.submit(request(kind))
    bench.clock.free()
    ended = bench.end_of(motion)
    assert isinstance(ended, ErrorReply)
    assert ended.code == code
    bench.end_of(interrupt)
    assert bench.state() == state
    assert 1 < hip(bench) < 29


def test_a_stop_while_it_samples_ends_the_motion(bench: Bench) -> None:
    bench.perform()
    bench.events.clear()
    bench.clock.freeze()
    motion = bench.submit(program(bench.robot, hip_left=30.0))
    while not any(isinstance(e, Progressed) and e.phase == "sampling" for e in bench.events):
        bench.clock.advance_to(bench.clock.now() + 0.02)
    bench.submit(request(Stop))
    bench.clock.free()
    ended = bench.end_of(motion)
    assert isinstance(ended, ErrorReply)
    assert ended.code == "aborted_stop"
    assert bench.state() == "stopped"


def test_a_stop_at_the_very_last_moment_ends_the_motion(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = bench.perform()
    verify, looks = bench.robot.servos.verify, []

    def stop_at_the_second_look(expected: Mapping[int, int]) -> list[int]:
        looks.append(expected)
        if len(looks) == 2:  # the samples are taken
            bench.submit(request(Stop))
        return verify(expected)

    monkeypatch.setattr(bench.robot.servos, "verify", stop_at_the_second_look)
    ended = bench.end_of(bench.submit(program(bench.robot, hip_left=30.0)))
    assert isinstance(ended, ErrorReply)
    assert ended.code == "aborted_stop"
    assert bench.robot.controller.snapshot().sequence == first.sequence


def test_a_silent_controller_leaves_a_holding_robot(bench: Bench) -> None:
    bench.clock.freeze()
    motion = bench.submit(program(bench.robot, hip_left=30.0))
    bench.clock.advance_to(0.2)
    bench.robot.controller.silence("The controller was silent for too long.")
    bench.clock.free()
    ended = bench.end_of(motion)
    assert isinstance(ended, ErrorReply)
    assert ended.code == "aborted_silent"
    snapshot = bench.robot.controller.snapshot()
    assert snapshot.state == "holding"
    assert snapshot.reason is not None
    assert "silent" in snapshot.reason


def test_stop_latches_until_clear(bench: Bench) -> None:
    bench.ok(Stop(id=1, client="anybody"))
    with pytest.raises(RobotError) as refused:
        bench.submit(program(bench.robot))
    assert refused.value.code == "stopped"
    bench.ok(Clear(id=1, client="test", session="s"))
    bench.perform()


def test_a_second_motion_is_refused_while_the_first_runs(bench: Bench) -> None:
    bench.clock.freeze()
    motion = bench.submit(program(bench.robot, hip_left=30.0))
    with pytest.raises(RobotError) as refused:
        bench.submit(program(bench.robot))
    assert refused.value.code == "busy"
    assert refused.value.retryable
    bench.clock.free()
    assert isinstance(bench.end_of(motion), ObservationReply)


def test_relax_alone_goes_limp_and_hold_comes_back(bench: Bench) -> None:
    bench.perform(hip_left=10.0)
    before = bench.pulses()
    bench.ok(Relax(id=1, client="test", session="s"))
    assert set(bench.pulses()) == {0}
    with pytest.raises(RobotError):
        bench.submit(program(bench.robot))
    bench.ok(Hold(id=1, client="test", session="s"))
    assert bench.pulses() == before


def test_reading_moves_nothing(bench: Bench) -> None:
    bench.perform(hip_left=10.0)
    before = bench.pulses()
    bench.robot.world.volts[3] += 1.0  # 5 N on the left foot
    first = bench.end_of(bench.submit(Read(id=1, client="test", session="s")))
    second = bench.end_of(bench.submit(Read(id=1, client="test", session="s")))
    assert isinstance(first, ObservationReply)
    assert isinstance(second, ObservationReply)
    assert first.touch == (True, False, False, False)
    assert second.sequence > first.sequence
    assert second.robot_time > first.robot_time
    assert bench.pulses() == before


def test_a_belly_on_the_ground_may_read_below_zero(bench: Bench) -> None:
    """Cut off at zero, the mean of many readings would be too large."""
    assert bench.robot.world.distance_mm is not None
    bench.robot.world.distance_mm -= 2.0
    seen = bench.end_of(bench.submit(Read(id=1, client="test", session="s")))
    assert isinstance(seen, ObservationReply)
    assert seen.clearance == pytest.approx(-0.002, abs=1e-3)
    assert not seen.clearance_saturated


def test_joints_at_their_ends_are_named(bench: Bench) -> None:
    joint = bench.robot.config.joints[0]
    upper = math.degrees(joint.reachable[1])
    assert bench.perform(hip_left=upper, hip_back=10.0).saturated_joints == ("hip_left",)
    seen = bench.end_of(bench.submit(Read(id=1, client="test", session="s")))
    assert isinstance(seen, ObservationReply)
    assert seen.saturated_joints == ("hip_left",)
    assert bench.perform(hip_left=upper - 1.0).saturated_joints == ()


def test_a_robot_that_does_not_lie_flat_is_not_moved(bench: Bench) -> None:
    bench.perform()
    bench.robot.world.volts[0] += math.sin(math.radians(5))  # nose up by 5°
    bench.robot.world.volts[2] -= 1 - math.cos(math.radians(5))
    refused = bench.end_of(bench.submit(program(bench.robot, hip_left=30.0)))
    assert isinstance(refused, ErrorReply)
    assert refused.code == "not_planar"
    assert refused.retryable
    assert hip(bench) == pytest.approx(0, abs=0.68)


def test_a_level_that_is_slightly_off_is_the_reference(bench: Bench) -> None:
    lean = math.radians(2)
    bench.robot.world.volts[0] += math.sin(lean)
    bench.perform()
    bench.robot.world.volts[0] -= 2 * math.sin(lean)  # -2°: level enough, 4° from the reference
    refused = bench.end_of(bench.submit(program(bench.robot)))
    assert isinstance(refused, ErrorReply)
    assert refused.code == "not_planar"
    bench.robot.controller.controller_changed("another")
    bench.perform()


def test_the_tilt_in_the_zero_pose_comes_with_what_a_motion_observed(bench: Bench) -> None:
    bench.robot.world.volts[0] += math.sin(math.radians(2))  # nose up by 2°, in every pose here
    seen = bench.perform(hip_left=30.0)
    assert seen.zero_tilt is not None
    assert seen.zero_tilt == pytest.approx((0.0, math.radians(2)), abs=1e-3)
    read = bench.end_of(bench.submit(Read(id=1, client="test", session="s")))
    assert isinstance(read, ObservationReply)
    assert read.zero_tilt is None


def test_a_robot_that_stands_need_only_stand_as_it_did_first(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = bench.robot.config
    standing = replace(config, body=replace(config.body, lies_flat=False))
    monkeypatch.setattr(bench.robot.controller._interaction, "_config", standing)
    lean = math.sin(math.radians(10))
    bench.robot.world.volts[0] += lean
    bench.perform()
    bench.perform(hip_left=30.0)
    bench.robot.world.volts[0] -= lean
    refused = bench.end_of(bench.submit(program(bench.robot)))
    assert isinstance(refused, ErrorReply)
    assert refused.code == "not_planar"


def test_unplugging_while_moving_is_a_fault_until_cleared(bench: Bench) -> None:
    bench.clock.freeze()
    motion = bench.submit(program(bench.robot, hip_left=30.0))
    bench.clock.advance_to(0.2)
    bench.robot.servo_board.unplug()
    bench.clock.free()
    ended = bench.end_of(motion)
    assert isinstance(ended, ErrorReply)
    assert ended.code == "fault"
    assert "plugged" in ended.message
    assert bench.state() == "fault"
    with pytest.raises(RobotError) as refused:
        bench.submit(program(bench.robot))
    assert refused.value.code == "fault"


def test_a_reset_board_is_noticed(bench: Bench) -> None:
    bench.perform(hip_left=20.0)
    bench.clock.freeze()
    motion = bench.submit(program(bench.robot, hip_left=25.0))
    bench.clock.advance_to(bench.clock.now() + 0.4)
    bench.robot.servo_board.power_cycle()
    bench.clock.free()
    ended = bench.end_of(motion)
    assert isinstance(ended, ErrorReply)
    assert "reset" in ended.message
    cleared = bench.end_of(bench.submit(Clear(id=1, client="test", session="s")))
    assert cleared.TYPE == "ok"
    bench.perform(hip_left=20.0)


@pytest.mark.parametrize(("part", "fault"), [("daq", "stuck_busy"), ("distance", "nak")])
def test_a_failing_sensor_is_a_fault_not_a_reading(bench: Bench, part: str, fault: str) -> None:
    getattr(bench.robot, part).inject(fault)
    ended = bench.end_of(bench.submit(program(bench.robot)))
    assert isinstance(ended, ErrorReply)
    assert ended.code == "fault"
    getattr(bench.robot, part).mend()
    bench.ok(Clear(id=1, client="test", session="s"))
    bench.perform()


def test_an_accelerometer_that_feels_no_gravity_is_a_fault(bench: Bench) -> None:
    bench.robot.world.volts[2] -= 0.5
    ended = bench.end_of(bench.submit(program(bench.robot)))
    assert isinstance(ended, ErrorReply)
    assert "accelerometer" in ended.message


def test_a_shaking_robot_is_read_after_the_timeout_and_it_says_so(bench: Bench) -> None:
    shake(bench, at_zero=False)
    seen = bench.perform(hip_left=10.0)
    assert not seen.settled
    assert seen.settle_time >= bench.robot.config.settling.timeout


def test_a_robot_that_shakes_in_its_zero_pose_is_not_moved(bench: Bench) -> None:
    shake(bench, at_zero=True)
    refused = bench.end_of(bench.submit(program(bench.robot, hip_left=30.0)))
    assert isinstance(refused, ErrorReply)
    assert refused.code == "not_settled"
    assert refused.retryable
    assert hip(bench) == pytest.approx(0, abs=0.68)


def test_a_motion_that_is_interrupted_before_it_begins_never_moves(bench: Bench) -> None:
    bench.clock.freeze()
    first = bench.submit(program(bench.robot, hip_left=30.0))
    bench.clock.advance_to(0.1)
    bench.submit(Hold(id=1, client="test", session="s"))
    second = bench.submit(program(bench.robot, hip_left=-30.0))
    bench.submit(Stop(id=1, client="test"))
    bench.clock.free()
    for ticket in (first, second):
        assert isinstance(bench.end_of(ticket), ErrorReply)
    assert bench.state() == "stopped"


def test_targets_are_checked_by_the_type() -> None:
    with pytest.raises(ValueError, match=r"targets\.hip_left"):
        Perform(id=1, client="c", session="s", targets={"hip_left": math.nan})
