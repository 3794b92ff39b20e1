"""Encodes maps as msgpack frames and decodes them, strictly.

A frame is exactly one map with string keys, at most 64 KiB long. Within it: nil, booleans,
integers within ±(2**53 - 1), finite floats, UTF-8 strings, arrays and maps; no binary, no
extension types, no duplicate keys, nothing after the map. So every frame that passes means the same
in every language.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Any, Final, NoReturn

import msgpack

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.wire.field_checks import MAX_INTEGER

MAX_FRAME: Final = 65_536
"""Longest frame, bytes."""

MAX_MESSAGE: Final = 1 << 20
"""Bytes beyond which libzmq drops the connection unanswered; up to there, ``too_large``."""

MAX_NESTING: Final = 16
"""Deepest nesting of maps and arrays, the frame's own map included."""

MAX_LENGTH: Final = 1024
"""Most items of one array or map: keeps what a hostile header can make us allocate small."""

MAX_VALUES: Final = 2048
"""Most items of all arrays and maps of a frame together: keeps what decoding costs small."""

_WORDLESS: Final = {
    "FormatError": "it holds an invalid byte",
    "StackError": "it is nested too deeply",
}


def encode(message: Mapping[str, Any]) -> bytes:
    """Encodes a message's map; keys keep their order, floats take 8 bytes, integers the fewest.

    Raises:
        LocalProtocolError: The map holds what a frame may not, or takes more than 64 KiB.
    """
    flaw = _flaw(message, 1)
    if flaw is not None:
        raise LocalProtocolError(f"A message cannot hold {flaw}.")
    if _values(message) > MAX_VALUES:
        raise LocalProtocolError(f"A message cannot hold more than {MAX_VALUES} values.")
    try:
        frame: bytes = msgpack.packb(dict(message), use_bin_type=True)
    except (ValueError, TypeError) as error:
        raise LocalProtocolError(f"The message cannot be encoded: {error}.") from None
    if len(frame) > MAX_FRAME:
        raise LocalProtocolError(
            f"The message takes {len(frame)} bytes; a frame has at most {MAX_FRAME}."
        )
    return frame


def decode(frame: bytes) -> dict[str, Any]:
    """Decodes a frame.

    Raises:
        RemoteProtocolError: ``too_large`` beyond 64 KiB, else ``malformed``; it carries the
            request's id where that could be read.
    """
    if len(frame) > MAX_FRAME:
        raise RemoteProtocolError(
            f"The frame has {len(frame)} bytes; at most {MAX_FRAME} are allowed.", code="too_large"
        )
    hooks = _ContainerHooks()
    try:
        message = msgpack.unpackb(
            frame,
            raw=False,
            strict_map_key=True,
            list_hook=hooks.array,
            object_pairs_hook=hooks.map,
            ext_hook=_refuse_extension,
            max_array_len=MAX_LENGTH,
            max_map_len=MAX_LENGTH,
        )
    except UnicodeDecodeError:
        raise RemoteProtocolError("The frame holds a string that is not UTF-8.") from None
    except (ValueError, msgpack.exceptions.UnpackException) as error:
        sentence = str(error).strip().rstrip(".") or _WORDLESS.get(type(error).__name__, "invalid")
        raise RemoteProtocolError(f"The frame is not one msgpack map: {sentence:.200}.") from None
    if not isinstance(message, dict):
        raise RemoteProtocolError(f"The frame holds {_kind(message)} instead of a map.")
    flaw = _flaw(message, 1)
    if flaw is not None:
        raise RemoteProtocolError(f"A frame cannot hold {flaw}.", request_id=request_id_of(message))
    return message


def request_id_of(message: Mapping[str, Any]) -> int | None:
    """The id in a decoded map, or ``None`` where it has no valid one."""
    value = message.get("id")
    if isinstance(value, bool) or not isinstance(value, int):
        return None
    return value if 0 <= value <= MAX_INTEGER else None


class _ContainerHooks:
    """Looks at each array and map while a frame is decoded.

    It gives up at the first value too many, where an empty array or map counts as one: a frame may
    hold 65,000 of them. It refuses timestamps, for which msgpack does not call ``ext_hook``.
    """

    def __init__(self) -> None:
        self._values_left = MAX_VALUES

    def array(self, items: list[Any]) -> list[Any]:
        self._look_at(items)
        return items

    def map(self, pairs: Iterable[tuple[Any, Any]]) -> dict[str, Any]:
        mapping = _map_of(pairs)
        self._look_at(mapping.values())
        return mapping

    def _look_at(self, values: Collection[Any]) -> None:
        self._values_left -= len(values) or 1
        if self._values_left < 0:
            raise RemoteProtocolError(f"The frame holds more than {MAX_VALUES} values.")
        if any(isinstance(value, msgpack.Timestamp) for value in values):
            _refuse_extension(-1, b"")


def _map_of(pairs: Iterable[tuple[Any, Any]]) -> dict[str, Any]:
    mapping: dict[str, Any] = {}
    for key, value in pairs:
        if not isinstance(key, str):
            raise RemoteProtocolError(f"A map has the key {key!r:.60}; keys must be strings.")
        if key in mapping:
            raise RemoteProtocolError(f"A map has the key {key!r:.60} twice.")
        mapping[key] = value
    return mapping


def _refuse_extension(code: int, data: bytes) -> NoReturn:
    raise RemoteProtocolError(f"The frame holds extension type {code}; none is allowed.")


def _flaw(value: Any, depth: int) -> str | None:  # noqa: PLR0911 - one line per kind of value
    if value is None or isinstance(value, bool):
        return None
    if isinstance(value, str):
        return None if value.isascii() or _is_unicode(value) else "a string that is not Unicode"
    if isinstance(value, int):
        return None if abs(value) <= MAX_INTEGER else f"the integer {value}, beyond ±(2^53-1)"
    if isinstance(value, float):
        return None if math.isfinite(value) else f"the number {value}"
    if not isinstance(value, Mapping | list | tuple):
        return _kind(value)
    if depth > MAX_NESTING:
        return f"more than {MAX_NESTING} levels of nesting"
    if len(value) > MAX_LENGTH:
        return f"an array or map of more than {MAX_LENGTH} items"
    children = value
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str) or not _is_unicode(key):
                return f"the key {key!r:.60}"
        children = list(value.values())
    return next((flaw for item in children if (flaw := _flaw(item, depth + 1))), None)


def _values(value: Any) -> int:
    """Number of items of all arrays and maps in a value, as ``_ContainerHooks`` counts them."""
    if not isinstance(value, Mapping | list | tuple):
        return 0
    children = value.values() if isinstance(value, Mapping) else value
    return (len(value) or 1) + sum(map(_values, children))


def _is_unicode(value: str) -> bool:
    try:
        value.encode()
    except UnicodeEncodeError:  # half of a surrogate pair
        return False
    return True


def _kind(value: Any) -> str:
    return {
        bytes: "binary data",
        list: "an array",
        str: "a string",
        int: "an integer",
        float: "a number",
        bool: "a boolean",
        type(None): "nil",
    }.get(type(value), f"a {type(value).__name__}")
