"""Who goes first: a command ends reads and waits for none; what the state says meanwhile."""

from __future__ import annotations

import time
from collections.abc import Iterable
from concurrent.futures import as_completed
from contextlib import ExitStack
from itertools import chain, islice
from pathlib import Path
from threading import Semaphore, Thread
from typing import Any

import pytest

from protocol.errors import RobotError
from protocol.rules.server_core import MAX_READS
from protocol.transport.client import RobotClient
from protocol.transport.server import Server
from protocol.wire.messages import (
    Clear,
    ErrorReply,
    Hold,
    ObservationReply,
    Ok,
    Read,
    Relax,
    RobotRequest,
    Stop,
)
from tests.protocol.background import in_background
from tests.protocol.conftest import Keyring
from tests.robot.stepped import Bench, program, request, shake

READS = 128


def flood(bench: Bench) -> list[int]:
    """Reads that wait, and one under way that will not see the robot come to rest."""
    shake(bench, at_zero=True)
    bench.clock.freeze()
    tickets = [bench.submit(request(Read)) for _ in range(READS)]
    bench.clock.advance_to(bench.clock.now() + 0.05)
    return tickets


def ended(bench: Bench, ticket: int) -> ErrorReply:
    reply = bench.end_of(ticket)
    assert isinstance(reply, ErrorReply), reply
    return reply


@pytest.mark.parametrize(
    ("kind", "code", "state"),
    [
        (Relax, "aborted_read", "relaxed"),
        (Hold, "aborted_read", "holding"),
        (Clear, "aborted_read", "idle"),
        (Stop, "aborted_stop", "stopped"),
    ],
)
def test_a_command_ends_all_reads_and_waits_for_none(
    bench: Bench, kind: type[Any], code: str, state: str
) -> None:
    reads = flood(bench)
    begun = bench.clock.now()
    command = bench.submit(request(kind))
    bench.clock.free()
    assert bench.end_of(command) == Ok(id=1, state=state)
    assert bench.clock.now() - begun < 0.3  # s, most of it eight queries at 9600 baud
    assert {ended(bench, ticket).code for ticket in reads} == {code}
    assert all(ended(bench, ticket).retryable is (code == "aborted_read") for ticket in reads)


def test_a_perform_ends_all_reads_and_begins_at_once(bench: Bench) -> None:
    reads = flood(bench)
    begun = bench.clock.now()
    motion = bench.submit(program(bench.robot, hip_left=30.0))
    bench.clock.advance_to(begun + 0.3)
    assert {ended(bench, ticket).code for ticket in reads} == {"aborted_read"}
    assert bench.state() == "moving"
    bench.clock.free()
    assert ended(bench, motion).code == "not_settled"


def test_reads_that_come_after_a_command_wait_for_it(bench: Bench) -> None:
    bench.clock.freeze()
    bench.submit(request(Relax))
    reading = bench.submit(request(Read))
    holding = bench.submit(request(Hold))
    later = bench.submit(request(Read))
    bench.clock.free()
    assert ended(bench, reading).code == "aborted_read"
    assert bench.end_of(holding) == Ok(id=1, state="holding")
    assert isinstance(bench.end_of(later), ObservationReply)


def test_a_command_is_answered_before_all_whose_reads_it_ended(bench: Bench) -> None:
    reads = flood(bench)
    bench.robot.controller.set_notify(lambda: None)  # as if the server were busy
    bench.events += bench.robot.controller.events()
    stopping = bench.submit(request(Stop))
    bench.clock.free()
    deadline = time.monotonic() + 120
    while bench.state() != "stopped":
        assert time.monotonic() < deadline, bench.state()
    assert bench.robot.controller.shut_down()  # and with it everything has been told
    turns = list(iter(bench.robot.controller.events, []))
    assert turns[0][0].ticket == stopping
    assert max(map(len, turns)) < READS
    bench.events += chain.from_iterable(turns)
    assert {ended(bench, ticket).code for ticket in reads} == {"aborted_stop"}


def test_the_end_of_the_daemon_ends_reads(bench: Bench) -> None:
    reads = flood(bench)
    bench.clock.free()
    assert bench.robot.controller.shut_down()
    assert {ended(bench, ticket).code for ticket in reads} == {"shutting_down"}


def test_relaxed_means_that_the_joints_were_released(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    release, states = bench.robot.servos.release, []

    def observed(outputs: Iterable[int]) -> None:
        release(outputs)
        states.append(bench.state())

    monkeypatch.setattr(bench.robot.servos, "release", observed)
    assert bench.ok(Relax(id=1, client="test", session="s")).state == "relaxed"
    assert states == ["idle"]
    assert set(bench.pulses()) == {0}


def test_moving_means_that_the_motion_has_begun(bench: Bench) -> None:
    bench.ok(Relax(id=1, client="test", session="s"))
    bench.clock.freeze()
    holding = bench.submit(request(Hold))
    motion = bench.submit(program(bench.robot, hip_left=30.0))
    assert bench.state() == "relaxed"  # the hold is not done, and the motion waits for it
    with pytest.raises(RobotError) as refused:
        bench.submit(program(bench.robot))
    assert refused.value.code == "busy"
    bench.clock.free()
    assert bench.end_of(holding) == Ok(id=1, state="holding")
    assert isinstance(bench.end_of(motion), ObservationReply)


def test_the_answer_to_a_stop_says_what_the_stop_did(bench: Bench) -> None:
    bench.clock.freeze()
    bench.submit(program(bench.robot, hip_left=30.0))
    bench.clock.advance_to(bench.clock.now() + 0.3)
    stopping = bench.submit(request(Stop))
    clearing = bench.submit(request(Clear))
    motion = bench.submit(program(bench.robot, hip_left=30.0))
    bench.clock.free()
    assert bench.end_of(stopping) == Ok(id=1, state="stopped")
    assert bench.end_of(clearing) == Ok(id=1, state="holding")
    assert isinstance(bench.end_of(motion), ObservationReply)


def test_a_stop_ends_what_waits(bench: Bench) -> None:
    bench.clock.freeze()
    bench.submit(program(bench.robot, hip_left=30.0))
    bench.clock.advance_to(bench.clock.now() + 0.3)
    relaxing = bench.submit(request(Relax))
    stopping = bench.submit(request(Stop))
    bench.clock.free()
    assert bench.end_of(stopping) == Ok(id=1, state="stopped")
    assert ended(bench, relaxing).code == "aborted_stop"
    assert 0 not in bench.pulses()


def test_a_reason_lasts_as_long_as_its_state(bench: Bench) -> None:
    bench.clock.freeze()
    motion = bench.submit(program(bench.robot, hip_left=30.0))
    bench.clock.advance_to(bench.clock.now() + 0.3)
    bench.robot.controller.silence("The controller left.")
    bench.clock.free()
    assert ended(bench, motion).message == "The controller left."
    assert bench.robot.controller.snapshot().reason == "The controller left."
    bench.ok(Stop(id=1, client="anybody"))
    assert bench.robot.controller.snapshot().reason == "A client sent stop."
    bench.ok(Clear(id=1, client="test", session="s"))
    assert bench.robot.controller.snapshot().reason is None


def test_a_viewer_with_a_key_holds_up_nobody(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keyring, controller = Keyring(tmp_path), bench.robot.controller
    ann, bob = keyring.client("ann", "controller"), keyring.client("bob", "viewer")
    submit, submitted = controller.submit, Semaphore(0)

    def counted(ticket: int, asked: RobotRequest) -> None:
        submit(ticket, asked)
        submitted.release()

    monkeypatch.setattr(controller, "submit", counted)
    shake(bench, at_zero=True)
    bench.clock.freeze()
    with ExitStack() as stack:
        server = Server(controller, bind="tcp://127.0.0.1:*", keys=keyring.robot)
        serving = Thread(target=server.run)
        serving.start()
        stack.callback(serving.join)
        stack.callback(server.close)
        viewers = [
            stack.enter_context(RobotClient(server.endpoint, keys=bob)) for _ in range(MAX_READS)
        ]
        steering = stack.enter_context(RobotClient(server.endpoint, keys=ann))
        stack.callback(bench.clock.free)
        steering.acquire()
        reads = [in_background(viewer.read) for viewer in viewers]
        assert all(submitted.acquire(timeout=120) for _ in reads)
        relaxing = in_background(steering.relax)
        waiting = islice(as_completed(reads, timeout=120), MAX_READS - 1)
        errors = [read.exception() for read in waiting]  # while time stands still for the robot
        bench.clock.free()
        assert relaxing.result(20).state == "relaxed"
        errors += [read.exception(20) for read in reads]
    assert {error.code for error in errors if isinstance(error, RobotError)} == {"aborted_read"}
    assert len(errors) == 2 * MAX_READS - 1
