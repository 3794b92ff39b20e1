"""Values of a problem file, and the sentence that says what is wrong with them.

Each annotated type turns what TOML holds into what code uses, or complains. ``None`` stands for a
trait that is to be found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, Any, Final, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError

from estimator.body.mounts import Vector
from estimator.readings.plausibility import DENSITIES, LENGTHS

UNKNOWN: Final = "unknown"

_SHORTEST_AXIS: Final = 1e-6  # a shorter one has no direction


def _parse_name_or_unknown(value: Any) -> str | None:
    if not isinstance(value, str) or not value:
        raise ValueError(f"must be a name or {UNKNOWN!r}, not {value!r}")
    return None if value == UNKNOWN else value


def _parse_parent(value: Any) -> int | None:
    if value == UNKNOWN:
        return None
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ValueError(
            f"must be 0 (the main body), the number of an earlier part or {UNKNOWN!r}, "
            f"not {value!r}"
        )
    return value - 1


def _parse_range(value: Any) -> tuple[float, float]:
    ends = value if isinstance(value, list) else [value, value]
    numbers = [end for end in ends if isinstance(end, int | float) and not isinstance(end, bool)]
    if len(numbers) != len(ends) or len(ends) != 2:
        raise ValueError(f"must be a number or [lowest, highest], not {value!r}")
    if not all(math.isfinite(end) for end in numbers):
        raise ValueError(f"must be finite, not {value!r}")
    low, high = float(numbers[0]), float(numbers[1])
    if isinstance(value, list) and low >= high:
        raise ValueError(f"the lowest must lie below the highest, not {value!r}")
    return low, high


def _parse_length(value: Any) -> tuple[float, float]:
    low, high = _parse_range(value)
    if low < LENGTHS[0] or high > LENGTHS[1]:
        raise ValueError(f"must lie in {LENGTHS[0]:g} to {LENGTHS[1]:g} m, not {value!r}")
    return low, high


def _parse_angles(value: Any) -> tuple[float, float]:
    if not isinstance(value, list):
        raise ValueError(f"must be [lowest, highest], like [-30, 30], not {value!r}")
    low, high = _parse_range(value)
    if low < -180 or high > 180:
        raise ValueError(f"must lie within -180 to 180 degrees, not {value!r}")
    return low, high


def _is_number(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and math.isfinite(value)


def _parse_place(value: Any) -> Vector | float:
    if isinstance(value, list) and len(value) == 3 and all(map(_is_number, value)):
        if max(map(abs, value)) > LENGTHS[1]:
            raise ValueError(f"must lie within {LENGTHS[1]:g} m of the middle, not {value!r}")
        x, y, z = map(float, value)
        return x, y, z
    if _is_number(value) and 0 <= value <= 1:
        return float(value)
    raise ValueError(
        f"must be a point [x, y, z] in m for the main body, or for parts a fraction of the length "
        f"from 0 to 1, not {value!r}"
    )


def _parse_axis(value: Any) -> Vector:
    if not (isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))):
        raise ValueError(f"must be [x, y, z], not {value!r}")
    length = math.hypot(*value)
    if length < _SHORTEST_AXIS:
        raise ValueError(f"an axis needs a direction, and {value!r} has length zero")
    x, y, z = (part / length for part in value)
    return x, y, z


def _between(low: float, high: float, unit: str) -> AfterValidator:
    def check(value: float) -> float:
        if not low <= value <= high:
            raise ValueError(f"must lie in {low:g} to {high:g} {unit}, not {value:g}")
        return value

    return AfterValidator(check)


def _even(value: int) -> int:
    if value % 2:
        raise ValueError(f"must be even, not {value}: members mate in pairs")
    return value


Ends: TypeAlias = tuple[float, float]
Finite: TypeAlias = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Positive: TypeAlias = Annotated[Finite, Field(gt=0)]
Radius: TypeAlias = Annotated[Finite, _between(*LENGTHS, "m")]
Density: TypeAlias = Annotated[Finite, _between(*DENSITIES, "kg/m³")]
Spread: TypeAlias = Annotated[Finite, _between(0, 100, "of its unit")]
Count: TypeAlias = Annotated[int, Field(ge=1, le=1_000_000, strict=True)]
Population: TypeAlias = Annotated[Count, AfterValidator(_even)]
Name: TypeAlias = Annotated[str, Field(min_length=1, max_length=60)]
Number: TypeAlias = Annotated[Count, AfterValidator(lambda number: number - 1)]
"""Number of a joint or a sensor: counted from 1 in the file and from 0 in code."""

Angles: TypeAlias = Annotated[Ends, BeforeValidator(_parse_angles)]
"""``[lowest, highest]``, degrees."""


Length: TypeAlias = Annotated[Ends, BeforeValidator(_parse_length)]
"""``[lowest, highest]``, or one number for both, m."""

Parent: TypeAlias = Annotated[int | None, BeforeValidator(_parse_parent)]
NameOrUnknown: TypeAlias = Annotated[str | None, BeforeValidator(_parse_name_or_unknown)]

Place: TypeAlias = Annotated[Vector | float, BeforeValidator(_parse_place)]
"""A point on the main body, m from its middle, or a fraction of a part's length."""

Yaw: TypeAlias = Annotated[Finite, _between(-360, 360, "degrees")]
Elevation: TypeAlias = Annotated[Finite, _between(-90, 90, "degrees (-90 is down)")]
Axis: TypeAlias = Annotated[Vector, BeforeValidator(_parse_axis)]
"""A unit vector; in the file of any length but 0."""


_REASONS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "missing": "is missing",
        "too_short": "must hold at least one",
        "greater_than": "must be greater than {gt:g}, not {input!r}",
        "greater_than_equal": "must be at least {ge:g}, not {input!r}",
        "less_than_equal": "must be at most {le:g}, not {input!r}",
        "finite_number": "must be finite, not {input!r}",
        "float_type": "must be a number, not {input!r}",
        "int_type": "must be an integer, not {input!r}",
        "string_type": "must be a text in quotes, not {input!r}",
        "literal_error": "must be {expected}, not {input!r}",
        "tuple_type": "must be a list, or tables with [[{key}]] above each, not {input!r}",
        "union_tag_not_found": "must say of which {discriminator} it is",
        "union_tag_invalid": "must be of kind {expected_tags}, not {tag!r}",
        **dict.fromkeys(
            ("extra_forbidden", "unexpected_keyword_argument"), "is no key of a problem file"
        ),
        **dict.fromkeys(
            ("model_type", "dataclass_type", "model_attributes_type", "dict_type"),
            "must be a table of keys and values, not {input!r}",
        ),
    }
)
"""Reason that a person reads for each kind of complaint that pydantic makes."""


def complaint(
    error: ValidationError,
    origin: str,
    raw: Mapping[str, Any] = MappingProxyType({}),
    parts: Sequence[int] = (),
) -> str:
    """Returns all complaints of a validation as text: file, key (counted from 1), name and reason.

    Args:
        error: Error of the validation.
        origin: Name of the file.
        raw: Content of the file, for the names of the entries that are wrong.
        parts: For each part that was validated, the index of the part in the file that it comes
            from; a complaint about several that come from one is made once.
    """
    lines: list[str] = []
    flaws = error.errors()
    places = [flaw["loc"] for flaw in flaws]
    for flaw in flaws:
        if flaw["type"] == "too_short" and sum(place[:1] == flaw["loc"] for place in places) > 1:
            continue  # there are entries, each of them wrong
        place = list(flaw["loc"])
        if len(place) > 1 and place[0] == "parts" and isinstance(place[1], int):
            place[1] = parts[place[1]] if parts else place[1]
        key = ""
        for step in place:
            if isinstance(step, int):
                key += f"[{step + 1}]"
            else:
                key += f".{step}" if key else str(step)
        name = _entry_name(raw, place)
        reason = flaw["msg"].removeprefix("Value error, ")
        if flaw["type"] in _REASONS:
            context = flaw.get("ctx", {})
            reason = _REASONS[flaw["type"]].format(key=key, input=flaw["input"], **context)
        line = f"{key}{name}: {reason}" if key else reason
        if line not in lines:
            lines.append(line)
    return f"{origin}: " + "; ".join(lines)


def _entry_name(raw: Mapping[str, Any], place: Sequence[int | str]) -> str:
    """The name of the entry of a table that a place is in, in brackets."""
    table = raw.get(str(place[0])) if place else None
    if len(place) < 2 or not isinstance(place[1], int) or not isinstance(table, list):
        return ""
    entry = table[place[1]]
    name = entry.get("name") if isinstance(entry, dict) else None
    return f" ({name})" if isinstance(name, str) and name else ""
