"""Request ids: nothing is executed twice, whatever is lost, repeated or reordered."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.errors import RobotError
from protocol.rules.at_most_once import MAX_OUTCOMES
from protocol.rules.robot_interface import Finished, Progressed
from protocol.rules.server_core import Send, Submit
from protocol.wire.capabilities import Capabilities
from protocol.wire.codec import decode
from protocol.wire.messages import ErrorReply, Perform
from tests.protocol.rules.core_bench import TARGETS, ServerCoreBench, observation, one


def test_a_retry_gets_progress_then_the_first_outcome_and_never_moves_again(
    bench: ServerCoreBench,
) -> None:
    bench.control()
    ticket = bench.perform(2)

    def retry(peer: bytes) -> Send:
        (action,) = bench.send("c", "perform", 2, targets=TARGETS, peer=peer)
        assert isinstance(action, Send)
        assert action.peer == peer
        return action

    assert decode(retry(b"second").frame)["type"] == "accepted"
    event = Progressed(ticket=ticket, phase="moving", fraction=0.5, robot_time=2.0)
    assert one(Send, bench.core.progress(event)).peer == b"second"
    assert decode(retry(b"third").frame)["phase"] == "moving"
    end = one(Send, bench.core.finish(Finished(ticket=ticket, reply=observation(2))))
    assert end.peer == b"third"
    assert retry(b"fourth").frame == end.frame


def test_both_zeros_are_the_same_target(bench: ServerCoreBench) -> None:
    bench.control()
    one(Submit, bench.send("c", "perform", 2, targets={"a": 0.0, "b": -0.0}))
    again = bench.send("c", "perform", 2, targets={"a": -0.0, "b": 0})
    assert again == []  # the same request, under way, and nothing to tell yet


def test_the_order_of_targets_and_the_kind_of_number_do_not_matter(bench: ServerCoreBench) -> None:
    bench.control()
    first = one(Submit, bench.send("c", "perform", 2, targets={"a": 0.0, "b": 0.5}))
    bench.core.accept(first.ticket)
    again = bench.send("c", "perform", 2, targets={"b": 0.5, "a": 0}, extra=1)
    assert bench.reply(again)["type"] == "accepted"


@pytest.mark.parametrize(
    ("kind", "fields"),
    [("perform", {"targets": {"a": 0.1, "b": 0.2}}), ("read", {}), ("acquire", {})],
)
def test_another_request_with_the_same_id_is_refused(
    bench: ServerCoreBench, kind: str, fields: dict[str, Any]
) -> None:
    bench.control()
    bench.perform(2)
    assert bench.reply(bench.send("c", kind, 2, **fields))["code"] == "id_reused"


def test_an_overtaken_id_is_never_executed(bench: ServerCoreBench) -> None:
    bench.control()
    bench.perform(7)
    reply = bench.reply(bench.send("c", "perform", 6, targets=TARGETS))
    assert (reply["code"], reply["id"]) == ("out_of_order", 6)


def test_errors_are_outcomes_too(bench: ServerCoreBench) -> None:
    bench.hello("c")
    refused = bench.reply(bench.send("c", "perform", 1, targets=TARGETS))
    assert refused["code"] == "not_controller"
    bench.send("c", "acquire", 2)
    assert bench.reply(bench.send("c", "perform", 1, targets=TARGETS)) == refused
    submitted = one(Submit, bench.send("c", "perform", 3, targets=TARGETS))
    error = ErrorReply.of(RobotError("busy", "Busy."), request_id=3)
    bench.core.finish(Finished(ticket=submitted.ticket, reply=error))
    assert bench.reply(bench.send("c", "perform", 3, targets=TARGETS))["code"] == "busy"


def test_outcomes_survive_release_and_are_forgotten_oldest_first(bench: ServerCoreBench) -> None:
    bench.control()
    bench.core.finish(Finished(ticket=bench.perform(2), reply=observation(2)))
    bench.send("c", "release", 3)
    last = 2 + MAX_OUTCOMES - 1
    for number in range(4, last + 1):
        bench.send("c", "acquire", number)
    assert bench.reply(bench.send("c", "perform", 2, targets=TARGETS))["type"] == "observation"
    bench.send("c", "acquire", last + 1)
    reply = bench.reply(bench.send("c", "perform", 2, targets=TARGETS))
    assert (reply["code"], "unknown" in reply["message"]) == ("expired", True)  # it was carried out
    assert bench.reply(bench.send("c", "release", 3))["type"] == "ok"


def test_a_request_under_way_is_never_forgotten(bench: ServerCoreBench) -> None:
    bench.control()
    ticket = bench.perform(2)
    for number in range(3, 3 + 3 * MAX_OUTCOMES):
        bench.send("c", "acquire", number)
    bench.core.finish(Finished(ticket=ticket, reply=observation(2)))
    assert bench.reply(bench.send("c", "perform", 2, targets=TARGETS))["type"] == "observation"


def test_too_many_requests_under_way(bench: ServerCoreBench) -> None:
    bench.hello("c")
    for number in range(MAX_OUTCOMES):
        one(Submit, bench.send("c", "read", number))
    assert bench.reply(bench.send("c", "read", 100))["code"] == "busy"
    bench.core.finish(Finished(ticket=1, reply=observation(0)))
    one(Submit, bench.send("c", "read", 100))


def test_an_answer_with_the_wrong_id_is_a_bug(bench: ServerCoreBench) -> None:
    bench.control()
    ticket = bench.perform(2)
    with pytest.raises(ValueError, match="request 2 was answered with id 3"):
        bench.core.finish(Finished(ticket=ticket, reply=observation(3)))


steps = st.lists(
    st.tuples(
        st.sampled_from(["send", "send", "lose", "end", "forget"]),
        st.integers(1, 90),
        st.sampled_from([0.1, 0.2]),
    ),
    max_size=120,
)


@given(steps)
@settings(max_examples=60)
def test_no_order_of_frames_executes_an_id_twice(
    capabilities: Capabilities, script: list[tuple[str, int, float]]
) -> None:
    """Frames lost, repeated, reordered, changed; answers early or late."""
    bench = ServerCoreBench(capabilities)
    bench.control()
    executed: dict[int, dict[str, float]] = {}
    under_way: list[tuple[int, int]] = []
    outcomes: dict[int, bytes] = {}
    for what, number, angle in script:
        if what == "send":
            actions = bench.send("c", "perform", number + 1, targets={"a": angle, "b": 0.0})
            for action in actions:
                if isinstance(action, Submit):
                    assert isinstance(action.request, Perform)
                    assert action.request.id not in executed
                    assert action.request.id > max(executed, default=0)
                    executed[action.request.id] = dict(action.request.targets)
                    bench.core.accept(action.ticket)
                    under_way.append((action.ticket, action.request.id))
                elif isinstance(action, Send):
                    reply = decode(action.frame)
                    if reply["type"] == "observation":
                        assert executed[reply["id"]]["a"] == angle
                        assert outcomes[reply["id"]] == action.frame
        elif what == "end" and under_way:
            ticket, request_id = under_way.pop(number % len(under_way))
            reply_to = observation(request_id, sequence=len(outcomes) + 1)
            (sent,) = bench.core.finish(Finished(ticket=ticket, reply=reply_to))
            outcomes[request_id] = sent.frame
        elif what == "forget":
            bench.hello(f"viewer-{number}")
