"""Parses TOML that anybody may have written.

``tomllib`` alone ends in a ``RecursionError`` for a thousand brackets, in gigabytes for a long
dotted key, and in integers that neither fit a float nor can be printed. Here each is a sentence, as
every other slip is.
"""

from __future__ import annotations

import tomllib
from typing import Any, Final

TomlError = tomllib.TOMLDecodeError
"""What is wrong and, as far as it is known, where."""

DEEPEST: Final = 32
LONGEST: Final = 10_000
"""Of a line: tomllib takes time and memory with the square of a dotted key's length."""

_LARGEST: Final = 2**63 - 1  # TOML's own integers


def parse_toml(text: str) -> dict[str, Any]:
    """Parses TOML.

    Raises:
        TomlError: The text is no TOML, has a line beyond all measure, nests tables or arrays too
            deeply, or holds an integer of more than 64 bits.
    """
    if max(map(len, text.splitlines()), default=0) > LONGEST:
        raise TomlError(f"a line has more than {LONGEST} characters")
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise TomlError(_TOO_DEEP) from None
    except TomlError:
        raise
    except ValueError as error:  # an integer of thousands of digits, a date that is none
        raise TomlError(str(error)) from error
    _check(table)
    return table


_TOO_DEEP: Final = f"it is nested too deeply: tables and arrays may be nested {DEEPEST} deep"


def _check(table: dict[str, Any]) -> None:
    level: list[Any] = [table]
    for _ in range(DEEPEST):
        level = [inner for item in level for inner in _inside(item)]
        if not level:
            return
    raise TomlError(_TOO_DEEP)


def _inside(item: Any) -> list[Any]:
    if isinstance(item, int) and not -_LARGEST - 1 <= item <= _LARGEST:
        raise TomlError("an integer has more than 64 bits")
    if isinstance(item, dict):
        return list(item.values())
    return item if isinstance(item, list) else []
