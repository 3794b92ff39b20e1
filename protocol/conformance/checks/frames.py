"""Checks of section 2, and the malformed frames of ``vectors.json``."""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib import resources
from typing import Any, Final

from protocol.conformance.raw_connection import (
    Failed,
    Map,
    expect,
    pack,
    pack_small,
    pack_wide,
    said,
)
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_under_test import RobotUnderTest, TrialClient
from protocol.wire.codec import MAX_FRAME

VECTORS: Final[tuple[Map, ...]] = tuple(
    vector
    for vector in json.loads(
        resources.files("protocol").joinpath("vectors.json").read_text("utf-8")
    )
    if vector["kind"] == "malformed"
)

CLAUSE_OF: Final = {
    "2.1": "empty nil array truncated trailing-byte two-maps unused-byte",
    "2.2": "binary-key integer-key duplicate-key",
    "2.3": "binary-value extension timestamp not-utf-8 surrogate nan infinity",
    "2.4": "integer-too-large",
    "2.7": "boolean-id float-id boolean-target",
    "2.10": "no-type unknown-type a-reply-is-no-request",
    "7.1": "negative-id string-target missing-targets missing-session",
    "1.7": "nested-too-deeply",
    "1.8": "array-claims-too-much",
}
"""Names of vectors, by the clause that each breaks."""


def _by_vectors(clause: str, title: str) -> None:
    names = CLAUSE_OF[clause].split()
    vectors = [vector for vector in VECTORS if vector["name"] in names]

    def run(robot: RobotUnderTest) -> None:
        client = robot.client()
        for vector in vectors:
            _answered(client, vector, with_id=False)

    run.__doc__ = title
    check(clause, after=("2.11",))(run)


def _answered(client: TrialClient, vector: Map, *, with_id: bool) -> None:
    """Expects that the answer to a vector has its code and, where ``with_id``, its id."""
    ids = {vector["id"]} if with_id else {vector["id"], None, 0}
    answer = client.ask_raw(bytes.fromhex(vector["hex"]), *ids)
    if answer is None and with_id:
        raise Failed(f"The vector {vector['name']!r} has no answer with the id {vector['id']}.")
    expect(
        answer is not None and answer.get("code") == vector["code"],
        f"The vector {vector['name']!r} was answered with {said(answer)}, not {vector['code']}.",
    )


_by_vectors("2.1", "What is not exactly one map is malformed")
_by_vectors("2.2", "Keys are strings, each once in a map")
_by_vectors("2.3", "Binary, extensions, NaN, infinities and broken strings are malformed")
_by_vectors("2.4", "Integers beyond ±(2^53 − 1) are malformed")
_by_vectors("2.7", "A float or a boolean is no integer, a boolean no number")
_by_vectors("2.10", "A type that is not a request's is unknown_type, a missing one malformed")
_by_vectors("7.1", "Missing fields, and fields of another type or range, are malformed")
_by_vectors("1.7", "The vector with too many levels is malformed")
_by_vectors("1.8", "The vector that claims 2^31 items is malformed")


def _with_extra(request: Map, key: bytes, value: bytes) -> bytes:
    """A frame with one more entry, given in bytes."""
    items = [pack_small(item) for pair in request.items() for item in pair]
    return bytes([0x80 + len(request) + 1]) + b"".join(items) + key + value


def _refused_for(client: TrialClient, frame: bytes, request: Map, what: str) -> None:
    """Expects that a frame with one flaw is malformed; the error may carry its id or none."""
    client.expect_raw(frame, ("malformed",), (None, request["id"]), what)


@check("2.1", after=("2.11",))
def more_than_a_frame(robot: RobotUnderTest) -> None:
    """A request with anything before or after it is malformed."""
    client = robot.client()
    beat = client.request("heartbeat")
    frame = pack(beat)
    for spoilt_frame, what in (
        (frame + b"\xc0", "A byte after a frame"),
        (frame + frame, "A frame twice"),
        (b"\xc0" + frame, "A byte before a frame"),
        (b"\x91" + frame, "A frame in an array"),
        (frame[:-1], "A frame without its last byte"),
    ):
        _refused_for(client, spoilt_frame, beat, what)


@check("2.2", after=("2.11",))
def odd_keys(robot: RobotUnderTest) -> None:
    """A request with a key twice, or one that is no string, is malformed."""
    client = robot.client()
    beat = client.request("heartbeat")
    for key, what in (
        (pack_small("id"), "The key id twice"),
        (b"\x05", "The key 5"),
        (b"\xc4\x01x", "A binary key"),
        (b"\xc0", "The key nil"),
    ):
        _refused_for(client, _with_extra(beat, key, pack_small(beat["id"])), beat, what)
    double_key = b"\x82\xa1a\x01\xa1a\x01"
    for value, what in (
        (double_key, "A key twice in an inner map"),
        (b"\x91" + double_key, "A key twice in a map in an array"),
        (b"\x81\xa1b" + double_key, "A key twice in a map in a map"),
    ):
        _refused_for(client, _with_extra(beat, pack_small("extra"), value), beat, what)
    perform = client.request("perform")
    frame = _with_extra(perform, pack_small("targets"), double_key)
    _refused_for(client, frame, perform, "A joint twice in the targets")


@check("2.3", after=("2.11",))
def odd_values(robot: RobotUnderTest) -> None:
    """A request with what no value may be is malformed, also in a field that is unknown."""
    client = robot.client()
    beat = client.request("heartbeat")
    for value, what in (
        (b"\xc4\x01x", "Binary"),
        (b"\xc7\x01\x05x", "An extension"),
        (b"\xd6\xff\0\0\0\0", "A timestamp"),
        (b"\xcb\x7f\xf8" + bytes(6), "NaN"),
        (b"\xca\xff\x80\0\0", "An infinity"),
        (b"\xa2\xc3\x28", "A string that is not UTF-8"),
    ):
        _refused_for(client, _with_extra(beat, pack_small("extra"), value), beat, what)


@check("2.12", after=("2.10", "2.11"))
def ids_of_errors(robot: RobotUnderTest) -> None:
    """An error carries the id of a frame that has a valid one, and else none."""
    client = robot.client()
    for vector in VECTORS:
        _answered(client, vector, with_id=True)


@check("2.4")
def extreme_integers(robot: RobotUnderTest) -> None:
    """Integers of ±(2^53 − 1) are accepted, beyond they are not."""
    client = robot.client()
    largest = 2**53 - 1
    client.expect("status", "heartbeat", id=largest)
    client.expect("status", "heartbeat", extra=[largest, -largest])
    for value in (largest + 1, -largest - 1):
        client.refused("malformed", f"The integer {value}", "heartbeat", extra=value)


@check("2.5", after=("3.5", "5.2"))
def any_encoding(robot: RobotUnderTest) -> None:
    """Any encoding of a value is accepted, and keys in any order."""
    client = robot.client()
    hello = client.request("hello", versions=[1])
    frame = pack_wide(hello)
    client.expect_raw(frame, ("welcome",), (hello["id"],), "hello in the longest encodings")
    perform = client.request("perform", targets={"no joint": 0.5})
    _parsed(client, perform, pack_small, "Targets as float 32")


@check("2.6", after=("5.2",))
def integer_for_float(robot: RobotUnderTest) -> None:
    """An integer is accepted for a float."""
    client = robot.client()
    perform = client.request("perform", targets={"no joint": 1})
    _parsed(client, perform, pack_small, "An integer as a target")


def _parsed(client: TrialClient, request: Map, packer: Callable[[Any], bytes], what: str) -> None:
    """Expects that an impossible ``perform`` is refused, but not for its form."""
    codes = ("not_controller", "unauthorised")
    client.expect_raw(packer(request), codes, (request["id"],), f"{what}, a valid frame")


@check("2.7")
def no_float_for_integer(robot: RobotUnderTest) -> None:
    """A float or a boolean is not accepted for an integer, even 1.0 for 1."""
    client = robot.client()
    for versions in ([1.0], [True]):
        client.refused("malformed", f"versions {versions}", "hello", versions=versions)


@check("2.8")
def nil(robot: RobotUnderTest) -> None:
    """A field that is nil is left out."""
    client = robot.client()
    hello = client.request("hello", versions=[1]) | {"software": None}
    client.expect_raw(pack(hello), ("welcome",), (hello["id"],), "hello with software nil")
    beat = client.request("heartbeat") | {"session": None}
    client.expect_raw(pack(beat), ("malformed",), (beat["id"],), "A heartbeat with session nil")


@check("2.9")
def unknown_fields(robot: RobotUnderTest) -> None:
    """Unknown fields are ignored."""
    client = robot.client()
    client.expect("status", "heartbeat", future={"a": [1, None, {"b": 0.5}]}, targets={"x": 1})
    number = client.number()
    first = client.harmless(number)
    repeat = client.harmless(number, future=1)
    expect(repeat == first, "A request with an unknown field more is taken for another one.")


@check("2.11", after=("3.5",))
def garbage(robot: RobotUnderTest) -> None:
    """Each invalid frame is answered, and changes nothing."""
    client = robot.client()
    before = client.status()
    session = client.session
    for number in range(100):
        frame = bytes([0xC1, number]) * (1 + number)
        client.connection.send_parts(frame)
        answer = client.connection.reply(None)
        expect(
            answer is not None and answer.get("code") == "malformed",
            f"The bytes {frame[:4].hex()}… were answered with {said(answer)}.",
        )
    after = client.status()
    for name in ("state", "sequence", "controller"):
        expect(after.get(name) == before.get(name), f"Garbage changed the robot's {name}.")
    client.hello()
    expect(client.session == session, "Garbage changed the client's session.")


@check("2.11", need=Need.CONTROL, after=("2.11", "5.1"))
def garbage_and_control(robot: RobotUnderTest) -> None:
    """No invalid frame, of the controller or of another, takes control away."""
    viewer = robot.client()
    with robot.controlled() as client:
        for sender in (client, viewer):
            mistaken = client.request("release")
            release = pack(mistaken | {"client": 5})
            for frame in (b"\xc1", bytes(MAX_FRAME + 1), release):
                sender.ask_raw(frame, None, mistaken["id"])
            for vector in VECTORS:
                sender.ask_raw(bytes.fromhex(vector["hex"]), None, vector["id"])
            sender.connection.send_parts(b"", pack(client.request("heartbeat")))
            sender.connection.reply(None)
            holder = viewer.status().get("controller")
            who = "the controller's" if sender is client else "another client's"
            expect(holder == client.name, f"After {who} garbage, {holder or 'nobody'} has control.")
