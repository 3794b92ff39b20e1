"""Checks of section 1: parts, sizes, keys."""

from __future__ import annotations

import math
from typing import Any, Final

import zmq

from protocol.conformance.expectations import Broken, Untried, expect
from protocol.conformance.raw_connection import Map, pack, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_on_trial import Party, RobotOnTrial
from protocol.rules.roles import MAY, Role
from protocol.security.keys import ClientKeys, KeyPair
from protocol.wire.codec import MAX_FRAME, MAX_LENGTH, MAX_MESSAGE, MAX_NESTING

_CURVE_OVERHEAD: Final = 33  # bytes that ZeroMQ adds to a part, and counts, where there are keys


@check("1.1")
def one_part(bench: RobotOnTrial) -> None:
    """A frame is one part, and so is its answer."""
    bench.party().status()  # a line takes nothing else for an answer


@check("1.2")
def several_parts(bench: RobotOnTrial) -> None:
    """A message of several parts is malformed."""
    party = bench.party()
    hello = pack(party.request("hello", versions=[1]))
    for parts, what in (((hello, hello), "two frames"), ((b"", hello), "an empty part first")):
        party.line.send_parts(*parts)
        beat = party.request("heartbeat")
        party.line.send(beat)
        expect(party.line.reply(beat["id"]) is not None, f"{what}: nothing is answered after it.")
        answer = party.line.reply(None, patience=0.3)
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
def long_frames(bench: RobotOnTrial) -> None:
    """A frame may have 64 KiB; a longer one is too_large."""
    party = bench.party()
    request = party.request("heartbeat")
    party.line.send_parts(_padded(request, MAX_FRAME))
    answer = party.line.reply(request["id"])
    expect(
        answer is not None and answer["type"] == "status",
        f"A frame of {MAX_FRAME} bytes was answered with {said(answer)}.",
    )
    for size in (MAX_FRAME + 1, MAX_MESSAGE - _CURVE_OVERHEAD):
        frame = _padded(party.request("heartbeat"), size)
        party.refused(frame, "too_large", None, f"A frame of {size} bytes")


@check("1.6")
def enormous_frames(bench: RobotOnTrial) -> None:
    """Beyond 1 MiB the connection is closed without an answer, and the robot goes on."""
    line = bench.line()
    watch = line.socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
    try:
        line.send_parts(bytes(MAX_MESSAGE + 1))
        closed = watch.poll(math.ceil(bench.settings.patience * 1000))
        expect(not line.socket.poll(0), "It was answered.")
        expect(bool(closed), "The connection stayed open.")
    finally:
        line.socket.disable_monitor()
        watch.close()
    bench.party().status()


def _nested(levels: int) -> list[Any]:
    value: list[Any] = []
    for _ in range(levels - 1):
        value = [value]
    return value


@check("1.7")
def nesting(bench: RobotOnTrial) -> None:
    """Maps and arrays nest to 16 levels and no further."""
    party = bench.party()
    party.expect("status", "heartbeat", extra=_nested(MAX_NESTING - 1))
    deep = party.request("heartbeat", extra=_nested(MAX_NESTING))
    party.refused(pack(deep), "malformed", deep["id"], f"{MAX_NESTING + 1} levels")


@check("1.8")
def lengths(bench: RobotOnTrial) -> None:
    """Arrays and maps have up to 1024 items."""
    party = bench.party()
    short: tuple[Any, ...] = ([0] * MAX_LENGTH, {str(key): 0 for key in range(MAX_LENGTH)})
    long: tuple[Any, ...] = ([0] * (MAX_LENGTH + 1), {str(key): 0 for key in range(MAX_LENGTH + 1)})
    for extra in short:
        party.expect("status", "heartbeat", extra=extra)
    for extra in long:
        frame = pack(party.request("heartbeat", extra=extra))
        party.refused(frame, "malformed", None, f"{MAX_LENGTH + 1} items")


@check("1.9")
def field_lengths(bench: RobotOnTrial) -> None:
    """An array or map field has up to 64 items."""
    party = bench.party()
    party.expect("welcome", "hello", versions=[1] * 64)
    hello = party.request("hello", versions=[1] * 65)
    party.refused(pack(hello), "malformed", hello["id"], "65 versions")
    targets = {f"no joint {number}": 0.0 for number in range(65)}
    perform = party.request("perform", targets=targets)
    party.refused(pack(perform), "malformed", perform["id"], "65 targets")


@check("1.10")
def names(bench: RobotOnTrial) -> None:
    """A name has 1 to 64 characters, whatever bytes they take."""
    stranger = bench.stranger()
    bench.party(stranger.name[:30] + "ä€𝄞" + "é" * 31)
    for name, what in (("", "An empty name"), ("é" * 65, "A name of 65 characters")):
        hello = stranger.request("hello", versions=[1], client=name)
        answer = stranger.ask_raw(pack(hello), hello["id"])
        expect(
            answer is not None and answer.get("code") == "malformed",
            f"{what} was answered with {said(answer)} instead of malformed.",
        )


@check("1.13", need=Need.KEYS)
def strangers(bench: RobotOnTrial) -> None:
    """Without a key, or with an unknown one, nothing is answered."""
    ours = bench.settings.keys
    assert ours is not None
    unknown = ClientKeys(
        own=KeyPair(*(key.decode() for key in zmq.curve_keypair())), robot=ours.robot
    )
    for keys, what in ((None, "without a key"), (unknown, "with an unknown key")):
        line = bench.line_with(keys)
        try:
            line.socket.setsockopt(zmq.SNDTIMEO, 500)
            line.send(Party(bench, "stranger", line).request("hello", versions=[1]))
            answer = line.reply(None, patience=0.5) or line.reply(2**52, patience=0.5)
        except Broken:
            continue  # no connection came about
        finally:
            line.close()
        expect(answer is None, f"hello {what} was answered with {said(answer)}.")


@check("1.15", need=Need.KEYS)
def a_viewers_key(bench: RobotOnTrial) -> None:
    """A viewer's key allows what the table allows, and nothing else."""
    party = bench.party()
    if party.ask("release").get("code") != "unauthorised":
        raise Untried("This key is a controller's.")
    for kind in sorted(MAY[Role.CONTROLLER] - MAY[Role.VIEWER]):
        party.expect("unauthorised", kind, **({"targets": {}} if kind == "perform" else {}))
    party.status()
    reply = party.ask("read")
    expect(reply.get("code") != "unauthorised", "A viewer was refused a read.")


@check("1.17", need=Need.KEYS)
def a_borrowed_id(bench: RobotOnTrial) -> None:
    """A client's id, used with another key, is unauthorised."""
    others = bench.settings.other_keys
    if others is None:
        raise Untried("This needs the keys of another client, --other-keys.")
    owner = bench.party()
    line = bench.line_with(others)
    try:
        thief = Party(bench, owner.name, line)
        thief.expect("unauthorised", "hello", versions=[1])
        thief.session = owner.session
        thief.expect("unauthorised", "heartbeat")
        thief.expect("unauthorised", "read")
    finally:
        line.close()
    owner.status()
