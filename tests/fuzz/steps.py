"""Turns bytes into a play: requests that are right, wrong in one place, wild, or noise.

Hypothesis draws the bytes, or libFuzzer grows them; either can shrink what it has found.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, Final

import msgpack

from tests.fuzz.reference import NEEDED
from tests.fuzz.subject import CLIENTS, Subject

KINDS: Final = (*NEEDED, "dance")
FIELDS: Final = ("type", "id", "client", "session", "targets", "versions", "software", "x")
WAITS: Final = (0.1, 1.0, 5.0, 30.0)
TARGETS: Final[tuple[dict[str, float], ...]] = (
    {"a": 0.1, "b": -0.1},
    {"b": 0, "a": 0.25},
    {"a": 0.1},
    {"a": 9.0, "b": 0.0},
    {},
)
ODD: Final[tuple[Any, ...]] = (
    *(None, True, False, 0, 1, -1, 2**53 - 1, 2**53, -(2**53), 2**64 - 1, -(2**63)),
    *(
        0.0,
        0.5,
        1e308,
        float("nan"),
        float("inf"),
        "",
        "x" * 64,
        "x" * 65,
        "ä\U0001d11e",
        "session-0",
    ),
    *(b"", b"x", msgpack.ExtType(5, b"x"), msgpack.Timestamp(1), [0] * 65, [0] * 1025),
)


class Source:
    """Bytes to be used up; beyond their end there are zeros."""

    def __init__(self, data: bytes):
        self._data = data
        self._place = 0

    @property
    def left(self) -> int:
        """How many there still are."""
        return len(self._data) - self._place

    def take(self, size: int) -> bytes:
        """The next so many; fewer at the end."""
        found = self._data[self._place : self._place + size]
        self._place += size
        return found

    def number(self, size: int = 1) -> int:
        """A number of so many bytes."""
        return int.from_bytes(self.take(size), "big")

    def one_of(self, choices: tuple[Any, ...]) -> Any:
        """One of these."""
        return choices[self.number() % len(choices)]


def play(subject: Subject, data: bytes) -> None:
    """Uses bytes up, step by step."""
    source = Source(data)
    ids = [100]
    while source.left > 0:
        source.one_of(_STEPS)(subject, source, ids)


_Ids = list[int]  # that were used, in growing order
_Step = Callable[[Subject, Source, _Ids], object]


def _request(subject: Subject, source: Source, ids: _Ids) -> dict[str, Any]:
    """A well-formed request, by one of the clients; mostly with a fresh id."""
    kind, choice = source.one_of(KINDS), source.number()
    client = CLIENTS[choice % len(CLIENTS)]
    if choice & 0xC0:
        ids.append(ids[-1] + 1)
        number = ids[-1]
    else:  # a retry, or an id that was overtaken
        number = ids[-1 - source.number() % min(len(ids), 100)]
    found: dict[str, Any] = {"type": kind, "id": number, "client": client}
    if kind not in ("hello", "stop"):
        found["session"] = subject.session(client) if choice % 11 else "other"
    if kind == "hello":
        found["versions"] = [1]
    if kind == "perform":
        found["targets"] = source.one_of(TARGETS)
    return found


def _ask(subject: Subject, source: Source, ids: _Ids) -> None:
    subject.feed(msgpack.packb(_request(subject, source, ids)), peer=source.take(1))


def _spoil(subject: Subject, source: Source, ids: _Ids) -> None:
    """A request with one byte more, less or changed."""
    frame = msgpack.packb(_request(subject, source, ids))
    how, value = source.number(), source.number()
    at = source.number() % (len(frame) + 1)
    before, after = frame[:at], frame[at:]
    flipped = bytes([after[0] ^ (1 << value % 8)]) if after else b""
    subject.feed(
        (
            before + bytes([value]) + after[1:],
            before + bytes([value]) + after,
            before + after[1 + value % 4 :],
            before,
            frame + after,
            before + flipped + after[1:],
        )[how % 6]
    )


def _change(subject: Subject, source: Source, ids: _Ids) -> None:
    """A request with a field changed, left out or added."""
    found = _request(subject, source, ids)
    found[source.one_of(FIELDS)] = _value(source, 0)
    if source.number() % 4 == 0:
        found.pop(source.one_of(FIELDS), None)
    subject.feed(msgpack.packb(found))


def _extend(subject: Subject, source: Source, ids: _Ids) -> None:
    """A request with one more entry, also one that it has already; or with any bytes for one."""
    frame = msgpack.packb(_request(subject, source, ids))
    if source.number() % 2:
        tail = msgpack.packb(source.one_of(FIELDS)) + msgpack.packb(_value(source, 2))
    else:
        tail = source.take(source.number() % 48)
    subject.feed(bytes([frame[0] + 1]) + frame[1:] + tail)


def _wild(subject: Subject, source: Source, ids: _Ids) -> None:
    del ids
    subject.feed(
        msgpack.packb({_key(source): _value(source, 0) for _ in range(source.number() % 8)})
    )


def _noise(subject: Subject, source: Source, ids: _Ids) -> None:
    del ids
    subject.feed(source.take(source.number() % 64))


def _time(subject: Subject, source: Source, ids: _Ids) -> None:
    del ids
    subject.wait(source.one_of(WAITS))


def _robot(subject: Subject, source: Source, ids: _Ids) -> None:
    del ids
    subject.complete() if source.number() % 2 else subject.progress()


_STEPS: Final[tuple[_Step, ...]] = (
    *(_ask, _ask, _ask, _ask, _spoil, _spoil, _spoil, _spoil, _change, _change),
    *(_extend, _extend, _wild, _wild, _noise, _time, _robot),
)


def _key(source: Source) -> Any:
    choice = source.number()
    if choice < 200:
        return FIELDS[choice % len(FIELDS)]
    return choice if choice < 210 else source.take(choice % 3).decode("latin-1")


def _value(source: Source, depth: int) -> Any:  # noqa: PLR0911 - one line per kind of value
    kind = source.number() % 10
    if kind <= 2:
        return source.one_of(ODD)
    if kind == 3:
        return source.one_of((*KINDS, *CLIENTS))
    if kind == 4:
        return source.number(8) - 2**63
    if kind == 5:
        return struct.unpack(">d", source.take(8).ljust(8, b"\0"))[0]
    if kind == 6:
        return source.take(source.number() % 8).decode("latin-1")
    if kind == 7:
        return _nested(source.number() % 20)
    if depth > 3:
        return source.number()
    if kind == 8:
        return [_value(source, depth + 1) for _ in range(source.number() % 4)]
    return {_key(source): _value(source, depth + 1) for _ in range(source.number() % 4)}


def _nested(levels: int) -> list[Any]:
    found: list[Any] = []
    for _ in range(levels):
        found = [found]
    return found
