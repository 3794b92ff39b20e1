"""After a fault: what stays down, what ``clear`` does, what it does not."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import cast

import pytest

from bench.still_robot import StillPi, StillRobot, still_pi, still_robot
from protocol.errors import RobotError
from protocol.rules.robot_interface import Progressed
from protocol.wire.messages import Clear, ErrorReply, Hold, ObservationReply, Ok, Read, Relax, Stop
from robot.errors import DeviceError
from sim_robot.faults.fault_panel import FaultSpec
from tests.robot.stepped import Bench, SteppedClock, program


def order(bench: Bench, fault: str) -> None:
    bench.robot.panel.order(FaultSpec.parse(fault))


def clear(bench: Bench) -> Ok | ErrorReply:
    reply = bench.end_of(bench.submit(Clear(id=1, client="test", session="s")))
    assert isinstance(reply, Ok | ErrorReply)
    return reply


def read(bench: Bench) -> int:
    return bench.submit(Read(id=1, client="test", session="s"))


def test_what_waits_when_a_device_fails_is_not_carried_out(bench: Bench) -> None:
    bench.perform()
    before = bench.pulses()
    bench.clock.freeze()
    bench.submit(program(bench.robot, hip_left=30.0))
    bench.clock.advance_to(bench.clock.now() + 0.01)
    order(bench, "servo_board.mute")
    holding = bench.submit(Hold(id=1, client="test", session="s"))
    motion = bench.submit(program(bench.robot, hip_left=30.0))  # accepted: that one holds first
    bench.clock.free()
    for ticket in (holding, motion):
        reply = bench.end_of(ticket)
        assert isinstance(reply, ErrorReply)
        assert reply.code == "fault"
    assert bench.pulses() == before
    assert bench.state() == "fault"


def test_a_clear_that_fails_leaves_the_robot_down_and_says_why(bench: Bench) -> None:
    order(bench, "distance.nak")
    bench.end_of(bench.submit(program(bench.robot)))
    for _ in range(2):
        reply = clear(bench)
        assert isinstance(reply, ErrorReply)
        assert reply.code == "fault"
        assert bench.state() == "fault"
        assert "acknowledges" in (bench.robot.controller.snapshot().reason or "")
    bench.robot.panel.mend()
    assert isinstance(clear(bench), Ok)
    assert bench.robot.controller.snapshot().reason is None
    bench.perform()


def test_nothing_moves_while_a_clear_is_under_way(bench: Bench) -> None:
    order(bench, "distance.nak")
    bench.end_of(bench.submit(program(bench.robot)))
    bench.robot.panel.mend()
    bench.clock.freeze()
    clearing = bench.submit(Clear(id=1, client="test", session="s"))
    bench.clock.advance_to(bench.clock.now() + 0.05)
    with pytest.raises(RobotError) as refused:
        bench.submit(program(bench.robot))
    assert refused.value.code == "fault"
    bench.clock.free()
    assert isinstance(bench.end_of(clearing), Ok)
    assert bench.state() == "holding"


def test_a_stop_that_comes_after_a_clear_outlasts_it(bench: Bench) -> None:
    order(bench, "distance.nak")
    bench.end_of(bench.submit(program(bench.robot)))
    bench.robot.panel.mend()
    bench.clock.freeze()
    first = bench.submit(Clear(id=1, client="test", session="s"))
    second = bench.submit(Clear(id=2, client="test", session="s"))
    bench.clock.advance_to(bench.clock.now() + 0.05)
    bench.submit(Stop(id=3, client="anybody"))
    bench.clock.free()
    for ticket in (first, second):
        reply = bench.end_of(ticket)
        assert isinstance(reply, ErrorReply)
        assert reply.code == "aborted_stop"
    assert bench.state() == "fault"
    assert isinstance(clear(bench), Ok)
    assert bench.state() == "holding"


def test_a_limp_robot_that_failed_is_held_when_it_is_cleared(bench: Bench) -> None:
    bench.perform(hip_left=20.0)
    before = bench.pulses()
    bench.ok(Relax(id=1, client="test", session="s"))
    order(bench, "daq.absent")
    assert isinstance(bench.end_of(read(bench)), ErrorReply)
    assert set(bench.pulses()) == {0}  # a fault freezes: limp stays limp
    bench.robot.panel.mend()
    assert isinstance(clear(bench), Ok)
    assert bench.pulses() == before


def test_joints_that_could_not_be_released_are_not_told_as_limp(bench: Bench) -> None:
    bench.perform(hip_left=20.0)
    driven = bench.pulses()
    told = bench.robot.controller.snapshot().angles
    bench.robot.servo_board.unplug()
    assert isinstance(
        bench.end_of(bench.submit(Relax(id=1, client="test", session="s"))), ErrorReply
    )
    assert bench.pulses() == driven
    assert bench.robot.controller.snapshot().angles == told


def test_joints_that_may_be_driven_are_not_told_as_limp(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.perform(hip_left=20.0)
    bench.ok(Relax(id=1, client="test", session="s"))
    assert not bench.robot.controller.snapshot().angles
    drive = bench.robot.servos.set_counts

    def half_way(counts: Mapping[int, int]) -> None:
        drive(dict(list(counts.items())[:1]))
        raise DeviceError("The second servo board is gone.", "Plug it in.")

    monkeypatch.setattr(bench.robot.servos, "set_counts", half_way)
    assert isinstance(
        bench.end_of(bench.submit(Hold(id=1, client="test", session="s"))), ErrorReply
    )
    assert any(bench.pulses())
    assert bench.robot.controller.snapshot().angles


def test_a_limp_robot_that_was_stopped_is_held_when_it_is_cleared(bench: Bench) -> None:
    bench.perform(hip_left=20.0)
    before = bench.pulses()
    bench.ok(Relax(id=1, client="test", session="s"))
    bench.ok(Stop(id=1, client="anybody"))
    assert set(bench.pulses()) == {0}  # a stop moves nothing
    assert isinstance(clear(bench), Ok)
    assert bench.state() == "holding"
    assert bench.pulses() == before
    bench.perform(hip_left=10.0)


def test_a_limp_robot_does_not_move_when_a_stop_follows_at_once(bench: Bench) -> None:
    bench.perform(hip_left=20.0)
    bench.ok(Relax(id=1, client="test", session="s"))
    bench.clock.freeze()
    holding = bench.submit(Hold(id=2, client="test", session="s"))
    bench.clock.advance_to(bench.clock.now() + 0.01)  # it asks the board
    stopping = bench.submit(Stop(id=3, client="anybody"))
    bench.clock.free()
    held = bench.end_of(holding)
    assert isinstance(held, ErrorReply)
    assert held.code == "aborted_stop"
    assert bench.end_of(stopping) == Ok(id=3, state="stopped")
    assert set(bench.pulses()) == {0}


def test_a_hold_does_not_leap_back_after_a_reset(bench: Bench) -> None:
    bench.perform(hip_left=60.0)
    bench.robot.servo_board.power_cycle()
    neutral = bench.pulses()
    reply = bench.end_of(bench.submit(Hold(id=1, client="test", session="s")))
    assert isinstance(reply, ErrorReply)
    assert "reset" in reply.message
    assert bench.pulses() == neutral


@pytest.mark.parametrize("kind", [Hold, Relax, Stop])
def test_a_reset_is_noticed_although_nobody_asks(kind: type[Hold | Relax | Stop]) -> None:
    clock = SteppedClock()
    with still_robot(clock, housekeeping=0.02, log=logging.getLogger("test")) as robot:
        bench = Bench(robot, clock)
        robot.controller.set_notify(bench.notify)
        robot.controller.start()
        bench.perform()
        bench.ok(kind(id=1, client="test", session="s"))
        bench.pulses()
        robot.servo_board.power_cycle()
        deadline = time.monotonic() + 120
        while bench.state() != "fault":
            assert time.monotonic() < deadline, bench.state()
        assert "reset" in (robot.controller.snapshot().reason or "")
        robot.controller.shut_down()


OTHERS = ("sleep", "doze", "prescale=60", "mode2=20", "moved=3", "full_on=3", "all_off")
"""What another program does to a PCA9685."""


@contextmanager
def on_a_pi(clock: SteppedClock, housekeeping: float | None) -> Iterator[tuple[StillPi, Bench]]:
    with still_pi(clock, housekeeping=housekeeping, log=logging.getLogger("test")) as robot:
        bench = Bench(cast(StillRobot, robot), clock)  # what is used here, both have
        robot.controller.set_notify(bench.notify)
        robot.controller.start()
        yield robot, bench
        robot.controller.shut_down()


@pytest.mark.parametrize("event", OTHERS)
def test_another_program_on_the_bus_is_noticed_although_nobody_asks(event: str) -> None:
    with on_a_pi(SteppedClock(), 0.02) as (robot, bench):
        bench.perform()
        written: list[tuple[int, int, int]] = []
        robot.pwm.on_pulse = lambda *move: written.append(move)
        order(bench, f"pwm.{event}")
        deadline = time.monotonic() + 120
        while bench.state() != "fault":
            assert time.monotonic() < deadline, bench.state()
        with pytest.raises(RobotError) as refused:
            read(bench)
        assert refused.value.code == "fault"
        assert not written


@pytest.mark.parametrize("event", OTHERS)
def test_another_program_while_it_settles_leaves_nothing_to_sample(event: str) -> None:
    clock = SteppedClock()
    with on_a_pi(clock, None) as (_, bench):
        bench.perform()
        moved_while_it_settles(bench, f"pwm.{event}")


def test_another_program_on_the_line_while_it_settles_likewise(bench: Bench) -> None:
    bench.perform()
    moved_while_it_settles(bench, "servo_board.moved=3")


def moved_while_it_settles(bench: Bench, fault: str) -> None:
    bench.events.clear()
    bench.clock.freeze()
    asked = read(bench)
    bench.clock.advance_to(bench.clock.now() + 0.1)
    order(bench, fault)
    bench.clock.free()
    ended = bench.end_of(asked)
    assert isinstance(ended, ErrorReply)
    assert ended.code == "fault"
    phases = {event.phase for event in bench.events if isinstance(event, Progressed)}
    assert phases == {"settling"}


def test_a_limp_robot_can_be_read_and_its_reset_is_noticed(bench: Bench) -> None:
    bench.perform()
    bench.ok(Relax(id=1, client="test", session="s"))
    seen = bench.end_of(read(bench))
    assert isinstance(seen, ObservationReply)
    assert seen.angles == {}  # nothing is commanded to a limp joint, and nobody knows where it is
    assert seen.saturated_joints == ()
    assert bench.robot.controller.snapshot().angles == {}
    bench.robot.servo_board.power_cycle()
    reply = bench.end_of(read(bench))
    assert isinstance(reply, ErrorReply)
    assert "reset" in reply.message


def test_a_board_that_was_reset_goes_on_from_where_it_is(bench: Bench) -> None:
    bench.perform(hip_left=60.0)
    bench.robot.servo_board.power_cycle()
    assert isinstance(bench.end_of(bench.submit(program(bench.robot))), ErrorReply)
    neutral = bench.pulses()
    assert isinstance(clear(bench), Ok)
    assert bench.pulses() == neutral
    scale = bench.robot.config.joints[0].scale
    angle = bench.robot.controller.snapshot().angles["hip_left"]
    assert angle == pytest.approx(scale.angle(neutral[0]))
    bench.perform(hip_left=60.0)


def test_the_line_is_opened_anew_under_the_same_name(bench: Bench) -> None:
    bench.perform()
    bench.robot.servo_board.unplug()
    assert isinstance(bench.end_of(bench.submit(program(bench.robot))), ErrorReply)
    reply = clear(bench)
    assert isinstance(reply, ErrorReply)
    assert "cannot be opened" in reply.message
    bench.robot.servo_board.replug()
    assert isinstance(clear(bench), Ok)
    assert math.degrees(bench.perform(hip_left=20.0).angles["hip_left"]) == pytest.approx(20, abs=1)


def test_axes_with_exchanged_wires_do_not_lie_flat(bench: Bench) -> None:
    order(bench, "daq.swapped_channels=1")  # y and z
    reply = bench.end_of(bench.submit(program(bench.robot)))
    assert isinstance(reply, ErrorReply)
    assert reply.code == "not_planar"


def test_a_foot_does_not_remember_an_earlier_pose(bench: Bench) -> None:
    """Between the thresholds of 0.05 and 0.1 N, a bit would stay as it was."""
    gauge = bench.robot.config.gauges["lower_left"]
    bench.robot.world.volts[gauge.channel] = gauge.tare + 1.0 * gauge.volts_per_newton
    assert bench.perform().touch == (True, False, False, False)
    bench.robot.world.volts[gauge.channel] = gauge.tare + 0.07 * gauge.volts_per_newton
    assert bench.perform(hip_left=10.0).touch == (False,) * 4
