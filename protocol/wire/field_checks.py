"""Checks that the constructors of messages share.

Each returns the value in its canonical type or raises ``LocalProtocolError`` with a sentence that
names the field. Integers are accepted wherever a float is meant; booleans are never numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, TypeVar

from protocol.errors import LocalProtocolError

T = TypeVar("T")

MAX_INTEGER: Final = 2**53 - 1
MAX_TEXT: Final = 1024
MAX_NAME: Final = 64
MAX_ITEMS: Final = 64
_LARGEST: Final = 10**308


def integer(name: str, value: Any, *, least: int = -MAX_INTEGER) -> int:
    """An integer of at least ``least`` and at most 2**53 - 1."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise LocalProtocolError(f"'{name}' must be an integer, not {value!r:.60}")
    if not least <= value <= MAX_INTEGER:
        raise LocalProtocolError(f"'{name}' must lie in {least} to 2^53-1, not {value!r:.60}")
    return value


def number(name: str, value: Any, *, least: float = -math.inf, most: float = math.inf) -> float:
    """A finite float of at least ``least`` and at most ``most``."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise LocalProtocolError(f"'{name}' must be a number, not {value!r:.60}")
    if isinstance(value, int) and abs(value) > _LARGEST:
        raise LocalProtocolError(f"'{name}' must be a number that a float can hold")
    if not math.isfinite(value):
        raise LocalProtocolError(f"'{name}' must be finite, not {value}")
    if value < least:
        raise LocalProtocolError(f"'{name}' must be at least {least}, not {value}")
    if value > most:
        raise LocalProtocolError(f"'{name}' must be at most {most}, not {value}")
    return float(value)


def boolean(name: str, value: Any) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise LocalProtocolError(f"'{name}' must be true or false, not {value!r:.60}")
    return value


def text(name: str, value: Any, *, longest: int = MAX_TEXT) -> str:
    """A non-empty string of at most ``longest`` characters."""
    if not isinstance(value, str):
        raise LocalProtocolError(f"'{name}' must be a string, not {value!r:.60}")
    if not 1 <= len(value) <= longest:
        raise LocalProtocolError(f"'{name}' must have 1 to {longest} characters, not {len(value)}")
    return value


def one_of(name: str, value: Any, choices: Iterable[str]) -> str:
    """One of the given strings."""
    allowed = tuple(choices)
    if value not in allowed:
        raise LocalProtocolError(f"'{name}' must be one of {', '.join(allowed)}, not {value!r:.60}")
    return str(value)


def items(
    name: str, value: Any, check: Callable[[str, Any], T], *, count: int | None = None
) -> tuple[T, ...]:
    """Checked items as a tuple: ``count`` of them, or at most 64; errors count them from 1."""
    if not isinstance(value, list | tuple):
        raise LocalProtocolError(f"'{name}' must be an array, not {value!r:.60}")
    if len(value) > MAX_ITEMS:
        raise LocalProtocolError(f"'{name}' must have at most {MAX_ITEMS} items, not {len(value)}")
    if count is not None and len(value) != count:
        raise LocalProtocolError(f"'{name}' must have {count} items, not {len(value)}")
    return tuple(check(f"{name} {number}", item) for number, item in enumerate(value, 1))


def mapping(name: str, value: Any, check: Callable[[str, Any], T]) -> dict[str, T]:
    """A map of at most 64 short names to checked values."""
    if not isinstance(value, Mapping):
        raise LocalProtocolError(f"'{name}' must be a map, not {value!r:.60}")
    if len(value) > MAX_ITEMS:
        raise LocalProtocolError(f"'{name}' must have at most {MAX_ITEMS} keys, not {len(value)}")
    return {
        text(f"{name} key", key, longest=MAX_NAME): check(f"{name}.{key}", item)
        for key, item in value.items()
    }


def optional(check: Callable[[str, Any], T]) -> Callable[[str, Any], T | None]:
    """A check that also accepts ``None`` (nil on the wire: absent)."""

    def checked(name: str, value: Any) -> T | None:
        return None if value is None else check(name, value)

    return checked
