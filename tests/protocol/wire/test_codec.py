from __future__ import annotations

import math
import random
import time
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgpack import fallback

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.wire.codec import MAX_FRAME, MAX_LENGTH, MAX_NESTING, MAX_VALUES, decode, encode

scalars = (
    st.none()
    | st.booleans()
    | st.integers(-(2**53) + 1, 2**53 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=40)
)
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=10), inner, max_size=5)
    ),
    max_leaves=20,
)
maps = st.dictionaries(st.text(max_size=10), values, max_size=8)


def verdict(frame: bytes) -> str:
    try:
        decode(frame)
    except RemoteProtocolError as error:
        return error.code
    return "valid"


@given(maps)
def test_what_is_encoded_decodes_to_itself(message: dict[str, Any]) -> None:
    again = decode(encode(message))
    assert again == message
    assert list(again) == list(message)
    assert [type(value) for value in again.values()] == [type(value) for value in message.values()]


@given(st.binary(max_size=200))
def test_garbage_raises_nothing_else(frame: bytes) -> None:
    assert verdict(frame) in ("valid", "malformed")


@given(maps, st.data())
def test_damaged_frames_raise_nothing_else(message: dict[str, Any], data: st.DataObject) -> None:
    frame = bytearray(encode(message))
    place = data.draw(st.integers(0, len(frame) - 1))
    frame[place] = data.draw(st.integers(0, 255))
    length = data.draw(st.integers(0, len(frame)))
    assert verdict(bytes(frame[:length])) in ("valid", "malformed")


def test_every_proper_prefix_is_malformed() -> None:
    frame = encode({"type": "hello", "id": 300, "targets": {"a": 1.5, "b": [None, True]}})
    for length in range(len(frame)):
        with pytest.raises(RemoteProtocolError, match="not one msgpack map"):
            decode(frame[:length])


def test_a_frame_may_have_64_kib_and_no_more() -> None:
    def padded(size: int) -> dict[str, Any]:
        return {"a": "x" * size}

    overhead = len(encode(padded(60_000))) - 60_000
    frame = encode(padded(MAX_FRAME - overhead))
    assert len(frame) == MAX_FRAME
    assert len(decode(frame)["a"]) == MAX_FRAME - overhead
    with pytest.raises(LocalProtocolError, match="65537 bytes"):
        encode(padded(MAX_FRAME - overhead + 1))
    with pytest.raises(RemoteProtocolError, match="at most 65536") as caught:
        decode(frame + b"\0")
    assert caught.value.code == "too_large"


@pytest.mark.parametrize(
    "value",
    [math.nan, -math.inf, 2**53, -(2**53), b"", b"x", {1: 2}, {"a": {b"b": 1}}, {1, 2}, "\ud800"],
)
def test_what_a_frame_cannot_hold_is_not_encoded(value: Any) -> None:
    with pytest.raises(LocalProtocolError):
        encode({"a": [value]})


def nested(levels: int) -> dict[str, Any]:
    value: Any = 0
    for _ in range(levels - 1):
        value = [value]
    return {"a": value}


def test_nesting_is_bounded_both_ways() -> None:
    assert decode(encode(nested(MAX_NESTING)))
    with pytest.raises(LocalProtocolError, match="nesting"):
        encode(nested(MAX_NESTING + 1))
    with pytest.raises(RemoteProtocolError, match="nesting"):
        decode(msgpack.packb(nested(MAX_NESTING + 1)))
    with pytest.raises(RemoteProtocolError):
        decode(b"\x91" * MAX_FRAME)


def test_lengths_are_bounded_both_ways() -> None:
    assert decode(encode({"a": [0] * MAX_LENGTH}))
    with pytest.raises(LocalProtocolError, match="1024 items"):
        encode({"a": [0] * (MAX_LENGTH + 1)})
    with pytest.raises(RemoteProtocolError, match="1024"):
        decode(msgpack.packb({"a": [0] * (MAX_LENGTH + 1)}))


def test_values_are_bounded_both_ways() -> None:
    def filled(empty: int) -> dict[str, Any]:
        """1 key, 3 rows, 2000 numbers, and arrays that count twice: as item, and as empty."""
        return {"a": [[0] * 1000, [0] * 1000, [[]] * empty]}

    most = (MAX_VALUES - 2004) // 2
    assert decode(encode(filled(most))) == filled(most)
    with pytest.raises(LocalProtocolError, match=f"{MAX_VALUES} values"):
        encode(filled(most + 1))
    with pytest.raises(RemoteProtocolError, match=f"{MAX_VALUES} values"):
        decode(msgpack.packb(filled(most + 1)))


def test_values_are_bounded_without_a_compiled_msgpack(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msgpack.unpackb", fallback.unpackb)
    assert decode(encode({"a": [{}, [1, {"b": []}]]})) == {"a": [{}, [1, {"b": []}]]}
    rows: list[list[Any]] = [[[]] * 1000, [{}] * 1000]
    for row in rows:
        with pytest.raises(RemoteProtocolError, match=f"{MAX_VALUES} values"):
            decode(msgpack.packb({"a": [row] * 3}))


ROW = b"\xdc\x03\xf8"  # an array of 1016 items


@pytest.mark.parametrize(
    "items",
    [b"\x80" * 1016, b"\x90" * 1016, b"\xc0" * 1016, b"\xa0" * 1016],
    ids=["maps", "arrays", "nils", "strings"],
)
def test_a_full_frame_of_small_values_costs_little(items: bytes) -> None:
    frame = b"\x81\xa1a" + b"\xdc\x00\x40" + 64 * (ROW + items)
    assert MAX_FRAME - 1024 < len(frame) <= MAX_FRAME
    spent = []
    for _ in range(5):
        begun = time.thread_time()
        with pytest.raises(RemoteProtocolError, match="values"):
            decode(frame)
        spent.append(time.thread_time() - begun)
    assert min(spent) < 0.005


def test_headers_that_claim_too_much_cost_nothing() -> None:
    claims = b"\x81\xa1a" + b"\xdd\x00\x00\x04\x00" * 12_000
    with pytest.raises(RemoteProtocolError):
        decode(claims)


def test_the_id_survives_a_flaw_elsewhere() -> None:
    with pytest.raises(RemoteProtocolError) as caught:
        decode(msgpack.packb({"id": 7, "x": math.nan}))
    assert caught.value.request_id == 7
    with pytest.raises(RemoteProtocolError) as caught:
        decode(msgpack.packb({"id": -7, "x": math.nan}))
    assert caught.value.request_id is None


EXTENSIONS = {
    "timestamp of 32 bits": b"\xd6\xff" + bytes(4),
    "timestamp of 64 bits": b"\xd7\xff" + bytes(8),
    "timestamp of 96 bits": b"\xc7\x0c\xff" + bytes(12),
    "no timestamp": b"\xc7\x05\xff" + bytes(5),
    "another extension": b"\xd6\x01" + bytes(4),
}


@pytest.mark.parametrize("extension", EXTENSIONS.values(), ids=EXTENSIONS)
@pytest.mark.parametrize("unpackb", [msgpack.unpackb, fallback.unpackb], ids=["compiled", "python"])
def test_a_frame_with_an_extension_is_not_decoded_so_its_id_is_not_known(
    extension: bytes, unpackb: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("msgpack.unpackb", unpackb)
    beyond = msgpack.packb(math.nan)  # a flaw that leaves the id known
    for value in (extension, b"\x91" + extension, b"\x81\xa1a" + extension):
        for before in (b"", b"\xa1b" + beyond):
            frame = bytes([0x82 + bool(before)]) + b"\xa2id\x09" + before + b"\xa1x" + value
            with pytest.raises(RemoteProtocolError) as caught:
                decode(frame)
            assert caught.value.request_id is None


def test_long_noise() -> None:
    noise = random.Random(5)
    for _ in range(200):
        with pytest.raises(RemoteProtocolError):
            decode(noise.randbytes(5000))
