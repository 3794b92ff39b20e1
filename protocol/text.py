"""Text from elsewhere: escaped and shortened to be shown, quoted to be typed; TOML, parsed safely.

``tomllib`` alone ends in a ``RecursionError`` for a thousand brackets, in gigabytes for a long
dotted key, and in integers that neither fit a float nor can be printed. ``parse_toml`` raises
``TomlError`` for each.
"""

from __future__ import annotations

import shlex
import tomllib
from typing import Any, Final

LONGEST: Final = 500
"""Most characters that ``brief`` returns by default."""


def printable(text: str, *, keep: str = "") -> str:
    """Returns the text with every character that is not printable shown as an escape.

    A name with an escape sequence in it can then neither recolour a terminal nor forge a line.

    Args:
        text: Anything.
        keep: Characters to leave as they are, such as line feeds.
    """
    return "".join(
        char
        if char.isprintable() or char in keep
        else char.encode("unicode_escape", "surrogatepass").decode()
        for char in text
    )


def brief(text: str, longest: int = LONGEST) -> str:
    """Returns the text; one longer than ``longest`` is cut, and its length is stated at the end."""
    if len(text) <= longest:
        return text
    ending = f"… ({len(text):,} characters)"
    return text[: longest - len(ending)] + ending


def command_line(*words: object) -> str:
    """Returns a command as it is to be typed in a shell: a word with blanks in it is quoted."""
    return shlex.join(map(str, words))


def error_text(error: BaseException) -> str:
    """Kind and text of an exception that foreign code raised, whatever its ``__str__`` does."""
    try:
        text = brief(str(error))
    except BaseException as unspeakable:  # the text of a foreign exception may raise anything
        text = f"its text cannot be had: {type(unspeakable).__name__}"
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


TomlError = tomllib.TOMLDecodeError
"""Error for text that is no valid TOML; says what is wrong and, where known, at which place."""

DEEPEST: Final = 32
LONGEST_LINE: Final = 10_000
"""Most characters of a line: tomllib's time and memory grow as the square of a dotted key."""

_LARGEST: Final = 2**63 - 1  # the largest integer of TOML itself


def parse_toml(text: str) -> dict[str, Any]:
    """Parses TOML.

    Raises:
        TomlError: The text is no TOML, has a line longer than ``LONGEST_LINE``, nests tables or
            arrays deeper than ``DEEPEST``, or holds an integer of more than 64 bits.
    """
    if max(map(len, text.splitlines()), default=0) > LONGEST_LINE:
        raise TomlError(f"a line has more than {LONGEST_LINE} characters")
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise TomlError(_TOO_DEEP) from None
    except TomlError:
        raise
    except ValueError as error:  # an integer of thousands of digits, an impossible date
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
