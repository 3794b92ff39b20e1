"""Values of a problem file, and the sentence that says what is wrong with them.

Each annotated type turns what TOML holds into what code uses, or complains. ``None`` stands for a
trait that is to be found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, Final, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError

from estimator.body.morphology import HINGES, SIDES
from estimator.readings.plausibility import DENSITIES, LENGTHS

UNKNOWN: Final = "unknown"


def _choice(names: Sequence[str]) -> BeforeValidator:
    def parse(value: Any) -> int | None:
        if value == UNKNOWN:
            return None
        if not isinstance(value, str) or value not in names:
            allowed = ", ".join(repr(name) for name in (*names, UNKNOWN))
            raise ValueError(f"must be one of {allowed}, not {value!r}")
        return list(names).index(value)

    return BeforeValidator(parse)


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
    low, high = _parse_range(value)
    if low < -180 or high > 180:
        raise ValueError(f"must lie within -180 to 180 degrees, not {value!r}")
    return low, high


def _count_from_0(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise ValueError(f"must be an integer of at least 1, not {value!r}")
    return value - 1


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
Positive: TypeAlias = Annotated[float, Field(gt=0, allow_inf_nan=False, strict=True)]
Radius: TypeAlias = Annotated[Positive, _between(*LENGTHS, "m")]
Density: TypeAlias = Annotated[Positive, _between(*DENSITIES, "kg/m³")]
Count: TypeAlias = Annotated[int, Field(ge=1, le=1_000_000, strict=True)]
Population: TypeAlias = Annotated[Count, AfterValidator(_even)]
Name: TypeAlias = Annotated[str, Field(min_length=1, max_length=60)]
Number: TypeAlias = Annotated[int, BeforeValidator(_count_from_0)]
"""Of a joint or a sensor: counted from 1 in the file and from 0 in code."""

Angles: TypeAlias = Annotated[Ends, BeforeValidator(_parse_angles)]
"""``[lowest, highest]``, or one number for both, degrees."""

Length: TypeAlias = Annotated[Ends, BeforeValidator(_parse_length)]
"""``[lowest, highest]``, or one number for both, m."""

Parent: TypeAlias = Annotated[int | None, BeforeValidator(_parse_parent)]
Side: TypeAlias = Annotated[int | None, _choice(SIDES)]
Hinge: TypeAlias = Annotated[int | None, _choice(HINGES)]


def complaint(error: ValidationError, origin: str, parts: Sequence[int] = ()) -> str:
    """Returns all complaints of a validation as text: file, key (counted from 1) and reason.

    Args:
        error: The validation's.
        origin: Names the file.
        parts: For each part that was validated, the index of the part in the file that it comes
            from; a complaint about several that come from one is made once.
    """
    lines = []
    for item in error.errors():
        place = list(item["loc"])
        if len(place) > 1 and place[0] == "parts" and isinstance(place[1], int):
            place[1] = parts[place[1]] if parts else place[1]
        key = ""
        for step in place:
            if isinstance(step, int):
                key += f"[{step + 1}]"
            else:
                key += f".{step}" if key else str(step)
        reasons = {
            "missing": "is missing",
            "extra_forbidden": "is no key of a problem file",
            "too_short": "must hold at least one",
        }
        reason = reasons.get(item["type"], item["msg"].removeprefix("Value error, "))
        line = f"{key}: {reason}" if key else reason
        if line not in lines:
            lines.append(line)
    return f"{origin}: " + "; ".join(lines)
