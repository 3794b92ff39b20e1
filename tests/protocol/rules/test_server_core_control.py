"""Who may move the robot, and what becomes of a controller that falls silent."""

from __future__ import annotations

import math
import re

import pytest

from protocol.rules.robot_interface import Finished
from protocol.rules.server_core import ControllerChanged, Send, Silence, Submit
from protocol.wire.messages import Ok
from tests.protocol.rules.core_bench import TARGETS, ServerCoreBench, observation, one


def test_one_controller_at_a_time_and_the_second_is_told_who(bench: ServerCoreBench) -> None:
    bench.hello("c", software="estimator 1")
    changed = one(ControllerChanged, bench.send("c", "acquire", 1))
    assert changed.client == "c"
    bench.hello("d")
    held = bench.reply(bench.send("d", "acquire", 1))
    assert held["code"] == "held"
    assert "estimator 1 (client c)" in held["message"]
    assert held["retryable"]
    assert bench.reply(bench.send("c", "acquire", 2))["type"] == "ok"  # has it already
    actions = bench.send("c", "release", 3)
    assert one(ControllerChanged, actions).client is None
    assert bench.reply(bench.send("d", "acquire", 1)) == held  # the first outcome stands
    assert one(ControllerChanged, bench.send("d", "acquire", 2)).client == "d"


@pytest.mark.parametrize("kind", ["perform", "hold", "relax", "clear", "release"])
def test_only_the_controller_may(bench: ServerCoreBench, kind: str) -> None:
    bench.control("c")
    bench.hello("d")
    fields = {"targets": TARGETS} if kind == "perform" else {}
    reply = bench.reply(bench.send("d", kind, 1, **fields))
    assert reply["code"] == "not_controller"
    assert "client c" in reply["message"]


def test_anybody_may_read_and_stop(bench: ServerCoreBench) -> None:
    bench.control("c")
    bench.hello("d")
    assert one(Submit, bench.send("d", "read", 1)).request.TYPE == "read"
    stop = one(Submit, bench.send("stranger", "stop", 0))
    assert stop.request.TYPE == "stop"
    bench.core.accept(stop.ticket)
    reply = bench.core.finish(Finished(ticket=stop.ticket, reply=Ok(id=0, state="stopped")))
    assert one(Send, reply).peer == b"stranger"


def test_stop_and_heartbeat_need_no_fresh_id(bench: ServerCoreBench) -> None:
    bench.control()
    bench.perform(9)
    for _ in range(2):
        assert bench.reply(bench.send("c", "heartbeat", 9))["type"] == "status"
        one(Submit, bench.send("c", "stop", 9))


@pytest.mark.parametrize(
    ("targets", "code", "named"),
    [
        ({"a": 0.0}, "bad_targets", "b"),
        ({}, "bad_targets", "a, b"),
        ({"a": 0.0, "b": 0.0, "c": 0.0}, "bad_targets", "c"),
        ({"a": 0.0, "b": 0.6001}, "out_of_range", "b"),
        ({"a": -0.6001, "b": 0.0}, "out_of_range", "a"),
    ],
)
def test_targets_that_do_not_fit_never_reach_the_robot(
    bench: ServerCoreBench, targets: dict[str, float], code: str, named: str
) -> None:
    bench.control()
    reply = bench.reply(bench.send("c", "perform", 2, targets=targets))
    assert reply["code"] == code
    assert f" {named}" in reply["message"]


def test_a_limit_itself_is_within_reach(bench: ServerCoreBench) -> None:
    bench.control()
    one(Submit, bench.send("c", "perform", 2, targets={"a": 0.6, "b": -0.6}))


@pytest.mark.parametrize(
    ("beyond", "numbers"),
    [
        (1.0, "-0.6000 to 0.6000 rad, not 1.6000"),
        (1e-7, "-0.6000000 to 0.6000000 rad, not 0.6000001"),
        (math.ulp(0.6), "to 0.6000000000000000 rad, not 0.6000000000000001"),
    ],
)
def test_whatever_lies_beyond_a_limit_is_refused_with_numbers_that_show_it(
    bench: ServerCoreBench, beyond: float, numbers: str
) -> None:
    bench.control()
    for number, sign in ((2, 1.0), (3, -1.0)):
        targets = {"a": sign * (0.6 + beyond), "b": 0.0}
        reply = bench.reply(bench.send("c", "perform", number, targets=targets))
        assert reply["code"] == "out_of_range"
        if sign > 0:
            assert numbers in reply["message"]
        shown = re.findall(r"-?\d+\.\d+", reply["message"])
        assert len(set(shown)) == 3, reply["message"]


def test_a_silent_controller_is_told_to_the_robot_once_then_loses_control(
    bench: ServerCoreBench,
) -> None:
    bench.control()
    deadlines = [bench.core.deadline]
    assert bench.core.tick(104.9) == []
    assert bench.core.tick(105.0) == [Silence()]
    assert bench.core.tick(129.9) == []
    deadlines.append(bench.core.deadline)
    assert bench.core.tick(130.0) == [ControllerChanged(None)]
    deadlines.append(bench.core.deadline)
    assert deadlines == [105.0, 130.0, None]
    assert bench.core.tick(1000.0) == []


def test_a_stall_of_the_daemon_reports_both(bench: ServerCoreBench) -> None:
    bench.control()
    assert bench.core.tick(500.0) == [Silence(), ControllerChanged(None)]


def test_any_word_ends_the_silence_and_a_new_one_is_told_again(bench: ServerCoreBench) -> None:
    bench.control()
    bench.core.tick(106.0)
    bench.now = 129.0
    bench.send("c", "heartbeat", 0)
    assert bench.core.tick(133.9) == []
    assert bench.core.controller == "c"
    assert bench.core.tick(134.0) == [Silence()]


@pytest.mark.parametrize("kind", ["stop", "hello-of-another", "garbage", "old-session"])
def test_other_frames_are_no_sign_of_life(bench: ServerCoreBench, kind: str) -> None:
    bench.control()
    bench.now = 104.0
    if kind == "stop":
        ticket = one(Submit, bench.send("c", "stop", 0)).ticket
        bench.core.finish(Finished(ticket=ticket, reply=Ok(id=0, state="stopped")))
    elif kind == "hello-of-another":
        bench.hello("d")
    elif kind == "garbage":
        bench.core.receive(b"c", b"\xc1", bench.now)
    else:
        bench.send("c", "heartbeat", 0, session="old")
    assert bench.core.tick(105.0) == [Silence()]


def test_a_silence_says_that_it_is_one(bench: ServerCoreBench) -> None:
    bench.control()
    assert "silent" in one(Silence, bench.core.tick(105.0)).reason


@pytest.mark.parametrize("session", ["of nobody", None])
def test_a_stop_is_carried_out_whoever_it_says_it_is_from(
    bench: ServerCoreBench, session: str | None
) -> None:
    bench.hello("d", user="one")
    actions = bench.send("d", "stop", 1, user="another", peer=b"p", session=session)
    assert one(Submit, actions).request.TYPE == "stop"


def test_a_stop_that_is_not_carried_out_is_answered_in_time_as_not_confirmed(
    bench: ServerCoreBench,
) -> None:
    ticket = one(Submit, bench.send("d", "stop", 7)).ticket
    due = bench.core.deadline
    assert due is not None
    assert bench.now < due <= bench.now + 0.25
    assert bench.core.tick(due - 1e-6) == []
    reply = bench.reply(bench.core.tick(due))
    assert (reply["id"], reply["code"], reply["retryable"]) == (7, "not_confirmed", True)
    assert bench.core.tick(due + 1) == []
    assert bench.core.deadline is None
    late = Finished(ticket=ticket, reply=Ok(id=7, state="stopped"))
    assert bench.core.finish(late) == []  # it was told already
    with pytest.raises(KeyError):
        bench.core.finish(late)


def test_a_stop_that_is_carried_out_is_answered_once(bench: ServerCoreBench) -> None:
    tickets = [one(Submit, bench.send("d", "stop", number)).ticket for number in (7, 8)]
    reply = bench.reply(
        bench.core.finish(Finished(ticket=tickets[0], reply=Ok(id=7, state="idle")))
    )
    assert reply["type"] == "ok"
    assert bench.reply(bench.core.tick(bench.now + 1))["id"] == 8


def test_letting_go_in_mid_motion_lets_the_robot_hold(bench: ServerCoreBench) -> None:
    bench.control()
    bench.perform(2)
    actions = bench.send("c", "release", 3)
    assert actions[:2] == [Silence(), ControllerChanged(None)]
    assert "released" in one(Silence, actions).reason


def test_letting_go_at_rest_is_no_silence(bench: ServerCoreBench) -> None:
    bench.control()
    bench.core.finish(Finished(ticket=bench.perform(2), reply=observation(2)))
    assert bench.send("c", "release", 3)[0] == ControllerChanged(None)
