"""Checks of section 1: parts, sizes, keys."""

from __future__ import annotations

import math
from typing import Any, Final

import zmq

from protocol.conformance.expectations import Broken, Untried, expect
from protocol.conformance.raw_connection import Map, pack, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_on_trial import RobotOnTrial, TrialClient
from protocol.rules.roles import MAY, Role
from protocol.security.keys import ClientKeys, KeyPair
from protocol.wire.codec import MAX_FRAME, MAX_LENGTH, MAX_MESSAGE, MAX_NESTING

_CURVE_OVERHEAD: Final = 33  # bytes that ZeroMQ adds to a part, and counts, where there are keys


@check("1.1")
def one_part(robot: RobotOnTrial) -> None:
    """A frame is one part, and so is its answer."""
    robot.client().status()  # a line takes nothing else for an answer


@check("1.2")
def several_parts(robot: RobotOnTrial) -> None:
    """A message of several parts is malformed."""
    client = robot.client()
    hello = pack(client.request("hello", versions=[1]))
    for parts, what in (((hello, hello), "two frames"), ((b"", hello), "an empty part first")):
        client.connection.send_parts(*parts)
        beat = client.request("heartbeat")
        client.connection.send(beat)
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
def long_frames(robot: RobotOnTrial) -> None:
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
        client.refused(frame, "too_large", None, f"A frame of {size} bytes")


@check("1.6")
def enormous_frames(robot: RobotOnTrial) -> None:
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
def nesting(robot: RobotOnTrial) -> None:
    """Maps and arrays nest to 16 levels and no further."""
    client = robot.client()
    client.expect("status", "heartbeat", extra=_nested(MAX_NESTING - 1))
    deep = client.request("heartbeat", extra=_nested(MAX_NESTING))
    client.refused(pack(deep), "malformed", deep["id"], f"{MAX_NESTING + 1} levels")


@check("1.8")
def lengths(robot: RobotOnTrial) -> None:
    """Arrays and maps have up to 1024 items."""
    client = robot.client()
    short: tuple[Any, ...] = ([0] * MAX_LENGTH, {str(key): 0 for key in range(MAX_LENGTH)})
    long: tuple[Any, ...] = ([0] * (MAX_LENGTH + 1), {str(key): 0 for key in range(MAX_LENGTH + 1)})
    for extra in short:
        client.expect("status", "heartbeat", extra=extra)
    for extra in long:
        frame = pack(client.request("heartbeat", extra=extra))
        client.refused(frame, "malformed", None, f"{MAX_LENGTH + 1} items")


@check("1.9")
def field_lengths(robot: RobotOnTrial) -> None:
    """An array or map field has up to 64 items."""
    client = robot.client()
    client.expect("welcome", "hello", versions=[1] * 64)
    hello = client.request("hello", versions=[1] * 65)
    client.refused(pack(hello), "malformed", hello["id"], "65 versions")
    targets = {f"no joint {number}": 0.0 for number in range(65)}
    perform = client.request("perform", targets=targets)
    client.refused(pack(perform), "malformed", perform["id"], "65 targets")


@check("1.10")
def names(robot: RobotOnTrial) -> None:
    """A name has 1 to 64 characters, whatever bytes they take."""
    stranger = robot.stranger()
    robot.client(stranger.name[:30] + "ä€𝄞" + "é" * 31)
    for name, what in (("", "An empty name"), ("é" * 65, "A name of 65 characters")):
        hello = stranger.request("hello", versions=[1], client=name)
        stranger.refused(pack(hello), "malformed", hello["id"], what)


@check("1.13", need=Need.KEYS)
def strangers(robot: RobotOnTrial) -> None:
    """Without a key, or with an unknown one, nothing is answered."""
    ours = robot.settings.keys
    assert ours is not None
    unknown = ClientKeys(
        own=KeyPair(*(key.decode() for key in zmq.curve_keypair())), robot=ours.robot
    )
    for keys, what in ((None, "without a key"), (unknown, "with an unknown key")):
        connection = robot.connection_with(keys)
        try:
            connection.socket.setsockopt(zmq.SNDTIMEO, 500)
            connection.send(
                TrialClient(robot, "stranger", connection).request("hello", versions=[1])
            )
            answer = connection.reply(None, patience=0.5) or connection.reply(2**52, patience=0.5)
        except Broken:
            continue  # no connection came about
        finally:
            connection.close()
        expect(answer is None, f"hello {what} was answered with {said(answer)}.")


@check("1.15", need=Need.KEYS)
def a_viewers_key(robot: RobotOnTrial) -> None:
    """A viewer's key allows what the table allows, and nothing else."""
    client = robot.client()
    if client.ask("release").get("code") != "unauthorised":
        raise Untried("This key is a controller's.")
    for kind in sorted(MAY[Role.CONTROLLER] - MAY[Role.VIEWER]):
        client.expect("unauthorised", kind, **({"targets": {}} if kind == "perform" else {}))
    client.status()
    reply = client.ask("read")
    expect(reply.get("code") != "unauthorised", "A viewer was refused a read.")


@check("1.17", need=Need.KEYS)
def a_borrowed_id(robot: RobotOnTrial) -> None:
    """A client's id, used with another key, is unauthorised."""
    others = robot.settings.other_keys
    if others is None:
        raise Untried("This needs the keys of another client, --other-keys.")
    owner = robot.client()
    connection = robot.connection_with(others)
    try:
        thief = TrialClient(robot, owner.name, connection)
        thief.expect("unauthorised", "hello", versions=[1])
        thief.session = owner.session
        thief.expect("unauthorised", "heartbeat")
        thief.expect("unauthorised", "read")
    finally:
        connection.close()
    owner.status()
