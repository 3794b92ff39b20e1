"""What a frame means, by ``SPEC.md`` alone: a second, slow reading of it to compare ours with.

It shares no code with ``protocol``: its own MessagePack decoder, its own table of fields.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any, Final

EXTREME: Final = 2**53 - 1
LENGTH: Final = 1024
LEVELS: Final = 16

_WIDTHS: Final = {0xCC: "B", 0xCD: "H", 0xCE: "I", 0xCF: "Q", 0xD0: "b", 0xD1: "h", 0xD2: "i",
                  0xD3: "q", 0xCA: "f", 0xCB: "d"}  # fmt: skip
_STRINGS: Final = {0xD9: "B", 0xDA: "H", 0xDB: "I"}
_ARRAYS: Final = {0xDC: "H", 0xDD: "I"}
_MAPS: Final = {0xDE: "H", 0xDF: "I"}


class Invalid(Exception):  # noqa: N818 - a verdict, not an error of ours
    """The frame is not what a frame may be."""


class _Reader:
    def __init__(self, data: bytes):
        self.data = data
        self.place = 0

    def take(self, size: int) -> bytes:
        found = self.data[self.place : self.place + size]
        if len(found) != size:
            raise Invalid("truncated")
        self.place += size
        return found

    def unpack(self, code: str) -> Any:
        return struct.unpack(f">{code}", self.take(struct.calcsize(code)))[0]

    def value(self, level: int) -> Any:  # noqa: PLR0911 - one line per kind of value
        head = self.take(1)[0]
        if head <= 0x7F:
            return head
        if head >= 0xE0:
            return head - 256
        if head in (0xC0, 0xC2, 0xC3):
            return {0xC0: None, 0xC2: False, 0xC3: True}[head]
        if head in _WIDTHS:
            return self.number(_WIDTHS[head])
        if 0xA0 <= head <= 0xBF or head in _STRINGS:
            return self.text(head & 0x1F if head <= 0xBF else self.unpack(_STRINGS[head]))
        if 0x90 <= head <= 0x9F or head in _ARRAYS:
            return self.array(head & 0xF if head <= 0x9F else self.unpack(_ARRAYS[head]), level)
        if 0x80 <= head <= 0x8F or head in _MAPS:
            return self.map(head & 0xF if head <= 0x8F else self.unpack(_MAPS[head]), level)
        raise Invalid(f"byte {head:02x}")  # binary, extensions, and what is no MessagePack

    def number(self, code: str) -> int | float:
        found: int | float = self.unpack(code)
        if isinstance(found, float) and not math.isfinite(found):
            raise Invalid("no number")
        if isinstance(found, int) and abs(found) > EXTREME:
            raise Invalid("too large an integer")
        return found

    def text(self, size: int) -> str:
        try:
            return self.take(size).decode("utf-8")
        except UnicodeDecodeError:
            raise Invalid("not UTF-8") from None

    def bounds(self, size: int, level: int) -> None:
        if size > LENGTH or level > LEVELS:
            raise Invalid("too long or too deep")

    def array(self, size: int, level: int) -> list[Any]:
        self.bounds(size, level)
        return [self.value(level + 1) for _ in range(size)]

    def map(self, size: int, level: int) -> dict[str, Any]:
        self.bounds(size, level)
        found: dict[str, Any] = {}
        for _ in range(size):
            key = self.value(level + 1)
            if not isinstance(key, str) or key in found:
                raise Invalid("a key that is no string, or comes twice")
            found[key] = self.value(level + 1)
        return found


def decode(frame: bytes) -> dict[str, Any]:
    """The map in a frame.

    Raises:
        Invalid: It is no frame.
    """
    reader = _Reader(frame)
    found = reader.value(1)
    if reader.place != len(frame) or not isinstance(found, dict):
        raise Invalid("not one map")
    return found


def _whole(value: Any, least: int) -> bool:
    return type(value) is int and least <= value <= EXTREME


def _name(value: Any) -> bool:
    return isinstance(value, str) and 1 <= len(value) <= 64


def _versions(value: Any) -> bool:
    return isinstance(value, list) and len(value) <= 64 and all(_whole(item, 1) for item in value)


def _targets(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and len(value) <= 64
        and all(_name(key) and type(item) in (int, float) for key, item in value.items())
    )


_Rule = Callable[[Any], bool]
_COMMON: Final[dict[str, _Rule]] = {"id": lambda value: _whole(value, 0), "client": _name}
_SESSION: Final[dict[str, _Rule]] = _COMMON | {"session": _name}
NEEDED: Final[dict[str, dict[str, _Rule]]] = {
    "hello": _COMMON | {"versions": _versions},
    "stop": _COMMON,
    "perform": _SESSION | {"targets": _targets},
    **dict.fromkeys(
        ("heartbeat", "acquire", "release", "read", "hold", "relax", "clear"), _SESSION
    ),
}
OPTIONAL: Final[dict[str, dict[str, _Rule]]] = {
    "hello": {"software": _name},
    "stop": {"session": _name},
}


def verdict(frame: bytes) -> str | None:
    """The error code with which a frame is answered, or ``None`` for a valid request."""
    if len(frame) > 65_536:
        return "too_large"
    try:
        found = decode(frame)
    except Invalid:
        return "malformed"
    kind = found.get("type")
    if not isinstance(kind, str):
        return "malformed"
    if kind not in NEEDED:
        return "unknown_type"
    fine = all(rule(found.get(name)) for name, rule in NEEDED[kind].items())
    fine = fine and all(
        found.get(name) is None or rule(found[name])
        for name, rule in OPTIONAL.get(kind, {}).items()
    )
    return None if fine else "malformed"
