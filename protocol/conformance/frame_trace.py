"""Formats frames for people: in hex, and decoded."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import msgpack

from protocol.errors import RemoteProtocolError
from protocol.wire.codec import decode

_LONGEST: Final = 4096
"""Bytes of a frame that are shown, and characters of what it says."""


def shown(heading: str, parts: Sequence[bytes]) -> str:
    """Formats a message: for each part a line of hex and a line with the decoded content."""
    lines = []
    for number, part in enumerate(parts, 1):
        where = heading if len(parts) == 1 else f"{heading} part {number} of {len(parts)}"
        lines += [f"{where}: {len(part)} bytes {_cut(part.hex(), 2)}", f"    {_meaning(part)}"]
    return "\n".join(lines)


def _meaning(part: bytes) -> str:
    try:
        return _cut(plain(decode(part)), 1)
    except RemoteProtocolError as error:
        return f"{_leniently(part)}no frame: {error}"


def _leniently(part: bytes) -> str:
    """The content of bytes that are MessagePack but no valid frame."""
    try:
        value = msgpack.unpackb(part, strict_map_key=False)
    except Exception:
        return ""
    return f"{_cut(plain(value), 1)}; " if isinstance(value, Mapping) else ""


def plain(value: Any) -> str:
    """Formats a value as JSON; what JSON cannot express, as Python does."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{plain(key)}: {plain(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(plain, value)) + "]"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return repr(value)


def _cut(text: str, each: int) -> str:
    longest = _LONGEST * each
    return text if len(text) <= longest else f"{text[:longest]}…"
