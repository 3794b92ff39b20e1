"""Checks of section 1: parts, sizes, keys."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

import zmq

from protocol.conformance.raw_connection import (
    FINAL,
    GRACE,
    Failed,
    Map,
    Skipped,
    Unanswered,
    expect,
    pack,
    said,
)
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_under_test import RobotUnderTest, TrialClient
from protocol.rules.control import MAY, Role
from protocol.security.keys import ClientKeys, KeyPair
from protocol.wire.codec import MAX_FRAME, MAX_LENGTH, MAX_MESSAGE, MAX_NESTING

_CURVE_OVERHEAD: Final = 33  # bytes that ZeroMQ adds to a part, and counts, where there are keys


@check("1.1")
def one_part(robot: RobotUnderTest) -> None:
    """A frame is one part, and so is its answer."""
    robot.client().status()  # a line takes nothing else for an answer


@check("1.2")
def several_parts(robot: RobotUnderTest) -> None:
    """A message of several parts is malformed."""
    client = robot.client()
    hello = pack(client.request("hello", versions=[1]))
    for parts, what in (((hello, hello), "two frames"), ((b"", hello), "an empty part first")):
        client.connection.send_parts(*parts)
        beat = client.send("heartbeat")
        expect(
            client.connection.reply(beat["id"]) is not None,
            f"{what}: nothing is answered after it.",
        )
        answer = client.connection.reply(None, patience=0.3)
        expect(
            answer is not None and answer.get("code") == "malformed",
            f"A message of {what} was answered with {said(answer)} instead of malformed.",
        )


def _padded(request: Map, size: int) -> bytes:
    """A request with an unknown field that makes it exactly so long."""
    padding = size
    while (length := len(frame := pack(request | {"padding": "x" * padding}))) != size:
        padding += size - length
    return frame


@check("1.5")
def long_frames(robot: RobotUnderTest) -> None:
    """A frame may have 64 KiB; a longer one is too_large."""
    client = robot.client()
    request = client.request("heartbeat")
    client.connection.send_parts(_padded(request, MAX_FRAME))
    answer = client.connection.reply(request["id"])
    expect(
        answer is not None and answer["type"] == "status",
        f"A frame of {MAX_FRAME} bytes was answered with {said(answer)}.",
    )
    for size in (MAX_FRAME + 1, MAX_MESSAGE - _CURVE_OVERHEAD):
        frame = _padded(client.request("heartbeat"), size)
        client.expect_raw(frame, ("too_large",), (None,), f"A frame of {size} bytes")


@check("1.6")
def enormous_frames(robot: RobotUnderTest) -> None:
    """Beyond 1 MiB the connection is closed without an answer, and the robot goes on."""
    connection = robot.connection()
    watch = connection.socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
    try:
        connection.send_parts(bytes(MAX_MESSAGE + 1))
        closed = watch.poll(math.ceil(robot.settings.patience * 1000))
        expect(not connection.socket.poll(0), "It was answered.")
        expect(bool(closed), "The connection stayed open.")
    finally:
        connection.socket.disable_monitor()
        watch.close()
    robot.client().status()


def _nested(levels: int) -> list[Any]:
    value: list[Any] = []
    for _ in range(levels - 1):
        value = [value]
    return value


@check("1.7")
def nesting(robot: RobotUnderTest) -> None:
    """Maps and arrays nest to 16 levels and no further."""
    client = robot.client()
    client.expect("status", "heartbeat", extra=_nested(MAX_NESTING - 1))
    deep = _nested(MAX_NESTING)
    client.refused("malformed", f"{MAX_NESTING + 1} levels", "heartbeat", extra=deep)


@check("1.8")
def lengths(robot: RobotUnderTest) -> None:
    """Arrays and maps have up to 1024 items."""
    client = robot.client()
    short: tuple[Any, ...] = ([0] * MAX_LENGTH, {str(key): 0 for key in range(MAX_LENGTH)})
    long: tuple[Any, ...] = ([0] * (MAX_LENGTH + 1), {str(key): 0 for key in range(MAX_LENGTH + 1)})
    for extra in short:
        client.expect("status", "heartbeat", extra=extra)
    for extra in long:
        frame = pack(client.request("heartbeat", extra=extra))
        client.expect_raw(frame, ("malformed",), (None,), f"{MAX_LENGTH + 1} items")


@check("1.9")
def field_lengths(robot: RobotUnderTest) -> None:
    """An array or map field has up to 64 items."""
    client = robot.client()
    client.expect("welcome", "hello", versions=[1] * 64)
    client.refused("malformed", "65 versions", "hello", versions=[1] * 65)
    targets = {f"no joint {number}": 0.0 for number in range(65)}
    client.refused("malformed", "65 targets", "perform", targets=targets)


@check("1.10")
def names(robot: RobotUnderTest) -> None:
    """A name has 1 to 64 characters, whatever bytes they take."""
    stranger = robot.stranger()
    robot.client(stranger.name[:30] + "ä€𝄞" + "é" * 31)
    for name, what in (("", "An empty name"), ("é" * 65, "A name of 65 characters")):
        stranger.refused("malformed", what, "hello", versions=[1], client=name)


@check("1.13", need=Need.KEYS)
def strangers(robot: RobotUnderTest) -> None:
    """Without a key, or with an unknown one, nothing is answered."""
    our_keys = robot.settings.keys
    assert our_keys is not None
    unknown = ClientKeys(
        own=KeyPair(*(key.decode() for key in zmq.curve_keypair())), robot=our_keys.robot
    )
    for keys, what in ((None, "without a key"), (unknown, "with an unknown key")):
        connection = robot.connection_with(keys)
        try:
            connection.socket.setsockopt(zmq.SNDTIMEO, 500)
            connection.send(
                TrialClient(robot, "stranger", connection).request("hello", versions=[1])
            )
            answer = connection.reply(None, patience=0.5) or connection.reply(2**52, patience=0.5)
        except Failed:
            continue  # no connection came about
        finally:
            connection.close()
        expect(answer is None, f"hello {what} was answered with {said(answer)}.")


@check("1.15", need=Need.KEYS)
def a_viewers_key(robot: RobotUnderTest) -> None:
    """A viewer's key allows what the table allows, and nothing else."""
    client = robot.client()
    if client.ask("release").get("code") != "unauthorised":
        raise Skipped("This key is a controller's.")
    for kind in sorted(MAY[Role.CONTROLLER] - MAY[Role.VIEWER]):
        client.expect("unauthorised", kind, **({"targets": {}} if kind == "perform" else {}))
    client.status()
    reply = client.ask("read")
    expect(reply.get("code") != "unauthorised", "A viewer was refused a read.")


@contextmanager
def _thief(robot: RobotUnderTest, owner: TrialClient) -> Iterator[TrialClient]:
    """Another client's id and session, with other keys."""
    other_keys = robot.settings.other_keys
    if other_keys is None:
        raise Skipped("This needs the keys of another client, --other-keys.")
    connection = robot.connection_with(other_keys)
    try:
        thief = TrialClient(robot, owner.name, connection)
        thief.session = owner.session
        yield thief
    finally:
        connection.close()


@check("1.17", need=Need.KEYS)
def a_borrowed_id(robot: RobotUnderTest) -> None:
    """A client's id, used with another key, is unauthorised."""
    owner = robot.client()
    with _thief(robot, owner) as thief:
        thief.expect("unauthorised", "hello", versions=[1])
        thief.expect("unauthorised", "heartbeat")
        thief.expect("unauthorised", "read")
    owner.status()


@check("1.17", need=Need.KEYS, after=("5.9",))
def a_stop_with_a_borrowed_id(robot: RobotUnderTest) -> None:
    """A stop with a client's id is carried out, whatever its key."""
    with robot.controlled() as owner, _thief(robot, owner) as thief:
        reply = thief.expect("ok", "stop")
        expect(reply["state"] == "stopped", f"After stop the state is {reply['state']}.")


MOST: Final = 64
"""Requests that a client may have under way."""

_MOST_OF_A_KEY: Final = 8  # reads, without control
_FLOOD: Final = 200  # number of reads: three times what may be under way
_TOO_QUICK: Final = "It reads too quickly for that."


def _read_all(client: TrialClient, reads: Sequence[Map]) -> list[Map]:
    """Waits for all replies to reads that were sent, and returns them as they came."""
    waiting = {read["id"] for read in reads}
    replies: list[Map] = []
    while waiting:
        reply = client.connection.first_of(waiting)
        if reply is None:
            client.connection.expect_ids()  # an error without its id may have ended a read
            raise Unanswered(f"{len(waiting)} of {len(reads)} reads were not answered to the end.")
        replies.append(reply)
        if reply["type"] in FINAL:
            waiting.remove(reply["id"])
    return replies


def _most_under_way(replies: Sequence[Map]) -> int:
    """The most reads that had been accepted, and not ended, at the same time."""
    under_way: set[int] = set()
    most = 0
    for reply in replies:
        if reply["type"] == "accepted":
            under_way.add(reply["id"])
        elif reply["type"] in FINAL:
            under_way.discard(reply["id"])
        most = max(most, len(under_way))
    return most


def _time_of_a_read(client: TrialClient) -> float:
    begun = time.monotonic()
    client.expect("observation", "read")
    return time.monotonic() - begun


@check("4.11", need=Need.CONTROL, after=("5.9",))
def a_flood(robot: RobotUnderTest) -> None:
    """In a flood of reads all are answered, 64 at most are under way, and a stop ends it."""
    with robot.controlled() as client:
        reads = [client.request("read") for _ in range(_FLOOD)]
        for read in reads:
            client.connection.send(read)
        client.expect("ok", "stop")
        replies = _read_all(client, reads)
        client.expect("ok", "clear")
        most = _most_under_way(replies)
        expect(most <= MOST, f"{most} reads of one client were under way at once.")
        ends = {reply["id"]: reply for reply in replies if reply["type"] in FINAL}
        if not any(end.get("code") == "busy" for end in ends.values()):
            raise Skipped(_TOO_QUICK)
        last_end = ends[reads[-1]["id"]]
        if last_end.get("code") == "busy":
            repeat = client.answer_to(reads[-1])[1]
            expect(repeat.get("code") != "busy", "A read that was busy in a flood stays busy.")


@check("1.18", need=Need.KEYS)
def a_flood_of_a_key(robot: RobotUnderTest) -> None:
    """Of the reads of a key without control, 8 at most are under way, and one more is busy."""
    client = robot.client()
    reads = [client.request("read") for _ in range(4 * _MOST_OF_A_KEY)]
    for read in reads:
        client.connection.send(read)
    replies = _read_all(client, reads)
    most = _most_under_way(replies)
    expect(most <= _MOST_OF_A_KEY, f"{most} reads of one key were under way at once.")
    if not any(reply.get("code") == "busy" for reply in replies):
        raise Skipped(_TOO_QUICK)


@check("5.16", "5.15", need=Need.CONTROL)
def commands_go_before_reads(robot: RobotUnderTest) -> None:
    """A command ends the reads before it, and waits for none of them."""
    with robot.controlled() as client:
        read_time = min(_time_of_a_read(client) for _ in range(3))
        reads = [client.request("read") for _ in range(MOST - 1)]
        clear = client.request("clear")
        for request in (*reads, clear):
            client.connection.send(request)
        begun = time.monotonic()
        reply = client.connection.final(clear["id"], patience=robot.settings.motion)[1]
        waited = time.monotonic() - begun
        expect(reply["type"] == "ok", f"A clear among reads was answered with {said(reply)}.")
        ends = [reply for reply in _read_all(client, reads) if reply["type"] in FINAL]
        unexpected = {said(end) for end in ends} - {"observation", "aborted_read"}
        expect(not unexpected, f"Before a clear, reads ended with {', '.join(sorted(unexpected))}.")
        if any(end["type"] == "error" for end in ends):
            return
        expect(
            waited < max(read_time * len(reads) / 2, GRACE),
            f"A clear waited {waited:.2f} s for {len(reads)} reads.",
        )
        raise Skipped(_TOO_QUICK)
