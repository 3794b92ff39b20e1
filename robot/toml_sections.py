"""Reads a TOML file key by key, so that a wrong one is refused with file, key and reason.

A ``Section`` remembers where it stands in the file and which of its keys were asked for; ``done``
refuses the rest, so that a misspelt key is never silently ignored.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from protocol.text import TomlError, parse_toml
from robot.errors import ConfigError

_UNITS: Final = MappingProxyType(
    {
        "_deg_s": "degrees per second",
        "_deg": "degrees",
        "_mm": "millimetres",
        "_kg": "kilograms",
        "_ms": "milliseconds",
        "_s": "seconds",
        "_hz": "hertz",
        "_mhz": "megahertz",
        "_v": "volts",
        "_n": "newtons",
        "_us": "microseconds",
        "zero_g": "g",
        "g_per_g": "g",
        "volts_per_g": "volts",
        "volts_per_newton": "volts",
    }
)
"""Unit of a value, by the end of its key."""


def read_toml(path: Path) -> Section:
    """Opens a TOML file.

    Raises:
        ConfigError: The file is missing, unreadable, truncated or no TOML.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot be read: {error.strerror}.", file=str(path)) from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"is not UTF-8 text (byte {error.start}).", file=str(path)) from error
    return toml_section(text, str(path))


def toml_section(text: str, file: str) -> Section:
    """Returns the section of a whole TOML file; ``file`` names the file in messages.

    Raises:
        ConfigError: It is no TOML.
    """
    try:
        return Section(file, "", parse_toml(text))
    except TomlError as error:
        raise ConfigError(f"is not valid TOML: {error}.", file=file) from error


class Section:
    """One table of a TOML file."""

    def __init__(self, file: str, path: str, values: dict[str, Any]):
        self._file = file
        self._path = path
        self._values = values
        self._asked: set[str] = set()

    def refuse(self, key: str, reason: str) -> ConfigError:
        """The error that names this file, the key and the reason."""
        return ConfigError(reason, file=self._file, key=f"{self._path}{key}")

    def done(self) -> None:
        """Refuses keys that nobody asked for."""
        for key in self._values.keys() - self._asked:
            matches = difflib.get_close_matches(key, self._asked, n=1)
            hint = (
                f" Did you mean '{matches[0]}'?"
                if matches
                else f" Known: {', '.join(sorted(self._asked))}."
            )
            raise self.refuse(key, f"is not a known key.{hint}")

    def table(self, key: str) -> Section:
        """A required sub-table."""
        value = self._take(key)
        if not isinstance(value, dict):
            raise self.refuse(key, f"must be a table, written [{self._path}{key}].")
        return Section(self._file, f"{self._path}{key}.", value)

    def has(self, key: str) -> bool:
        """Whether an optional key or table is present."""
        self._asked.add(key)
        return key in self._values

    def tables(self, key: str) -> list[Section]:
        """A required array of tables, at least one."""
        value = self._take(key)
        if not isinstance(value, list) or not value or not all(isinstance(v, dict) for v in value):
            raise self.refuse(key, f"must be one or more tables, each written [[{key}]].")
        return [
            Section(self._file, f"{self._path}{numbered(key, number, item.get('name'))}.", item)
            for number, item in enumerate(value, 1)
        ]

    def text(self, key: str, default: str | None = None) -> str:
        """A non-empty string."""
        value = self._take(key, default)
        if not isinstance(value, str) or not value:
            raise self.refuse(key, f"must be a non-empty string, not {value!r}.")
        return value

    def choice(self, key: str, choices: Sequence[str], default: str | None = None) -> str:
        """One of some strings."""
        value = self.text(key, default)
        if value not in choices:
            raise self.refuse(key, f"must be one of {', '.join(choices)}, not {value!r}.")
        return value

    def integer(self, key: str, least: int, most: int, default: int | None = None) -> int:
        """An integer from ``least`` to ``most``."""
        value = self._take(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise self.refuse(key, f"must be an integer from {least} to {most}, not {value!r}.")
        return value

    def integers(
        self, key: str, least: int, most: int, default: tuple[int, ...], *, written: str = "{}"
    ) -> tuple[int, ...]:
        """An integer from ``least`` to ``most``, or an array of one or more, all different."""
        given = self._take(key, default)
        values = tuple(given) if isinstance(given, list | tuple) else (given,)
        sound = all(type(value) is int and least <= value <= most for value in values)
        if not sound or not values or len(set(values)) < len(values):
            first, last, a, b = map(written.format, (least, most, least + 1, least + 2))
            shown = ", ".join(
                written.format(value) if type(value) is int else repr(value) for value in values
            )
            raise self.refuse(
                key,
                f"must be an integer from {first} to {last}, or different ones as in "
                f"[{a}, {b}], not {f'[{shown}]' if isinstance(given, list) else shown}.",
            )
        return values

    def name_or_number(self, key: str, least: int, most: int) -> str | int:
        """A non-empty string, or an integer from ``least`` to ``most``."""
        value = self._take(key)
        if isinstance(value, str) and value:
            return value
        if type(value) is int and least <= value <= most:
            return value
        raise self.refuse(
            key, f"must be a name, or an integer from {least} to {most}, not {value!r}."
        )

    def one_of(self, key: str, choices: Sequence[int], default: int, *, written: str = "{}") -> int:
        """One of some integers; ``written`` is the format in which the message shows them."""
        value = self._take(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value not in choices:
            allowed = ", ".join(written.format(choice) for choice in choices)
            given = written.format(value) if isinstance(value, int) else repr(value)
            raise self.refuse(key, f"must be one of {allowed}, not {given}.")
        return value

    def number(self, key: str, least: float, most: float, default: float | None = None) -> float:
        """A finite number from ``least`` to ``most``."""
        return self._number(key, self._take(key, default), least, most)

    def number_or_zero(self, key: str, least: float, most: float) -> float:
        """A number from ``least`` to ``most``, or 0."""
        value = self._take(key)
        zero = isinstance(value, int | float) and not isinstance(value, bool) and value == 0
        return 0.0 if zero else self._number(key, value, least, most, also="0, or ")

    def magnitude(self, key: str, least: float, most: float) -> float:
        """A number of either sign; its absolute value lies in ``least`` to ``most``."""
        return self._magnitude(key, self._take(key), least, most)

    def magnitudes(self, key: str, count: int, least: float, most: float) -> tuple[float, ...]:
        """An array of ``count`` numbers, each as ``magnitude`` reads it."""
        return tuple(self._magnitude(key, item, least, most) for item in self._array(key, count))

    def numbers(
        self,
        key: str,
        count: int,
        least: float,
        most: float,
        default: Sequence[float] | None = None,
    ) -> tuple[float, ...]:
        """An array of ``count`` numbers."""
        values = self._array(key, count, default)
        return tuple(self._number(key, item, least, most) for item in values)

    def pairs(self, key: str) -> tuple[tuple[float, float], ...]:
        """An array of two or more pairs of finite numbers."""
        value = self._take(key)
        are_pairs = isinstance(value, list) and all(
            isinstance(pair, list) and len(pair) == 2 for pair in value
        )
        if not are_pairs or len(value) < 2:
            raise self.refuse(key, f"must be two or more pairs [[a, b], [c, d]], not {value!r}.")
        return tuple(
            (
                self._number(key, pair[0], -math.inf, math.inf),
                self._number(key, pair[1], -math.inf, math.inf),
            )
            for pair in value
        )

    def _array(self, key: str, count: int, default: Sequence[float] | None = None) -> list[Any]:
        value = self._take(key, default if default is None else list(default))
        if not isinstance(value, list) or len(value) != count:
            raise self.refuse(key, f"must be an array of {count} numbers, not {value!r}.")
        return value

    def _number(self, key: str, value: Any, least: float, most: float, *, also: str = "") -> float:
        if not _is_number(value) or not least <= value <= most:
            unit = next((f" {name}" for end, name in _UNITS.items() if key.endswith(end)), "")
            raise self.refuse(
                key, f"must be {also}a number from {least:g} to {most:g}{unit}, not {value!r}."
            )
        return float(value)

    def _magnitude(self, key: str, value: Any, least: float, most: float) -> float:
        if _is_number(value) and value < 0:
            return -self._number(key, -value, least, most, also="(without its sign) ")
        return self._number(key, value, least, most, also="(without its sign) ")

    def _take(self, key: str, default: Any = None) -> Any:
        self._asked.add(key)
        if key in self._values:
            return self._values[key]
        if default is None:
            raise self.refuse(key, "is missing.")
        return default


def numbered(key: str, number: int, name: object) -> str:
    """Name of one of several tables, for messages: ``joint 2 (hip_front)``, counted from 1."""
    return f"{key} {number} ({name:.64})" if name and isinstance(name, str) else f"{key} {number}"


def _is_number(value: Any) -> bool:
    is_real = isinstance(value, int | float) and not isinstance(value, bool)
    return is_real and math.isfinite(value)
