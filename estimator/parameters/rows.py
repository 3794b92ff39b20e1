"""The table: in what robots differ from their problems, and by how much.

Narrow spreads are those of robots as people build them, wide ones what is noticed only by moving.
Causes that feel the same have one row, whose sentence names both: ground that slopes and an
accelerometer that is turned, a foot and the part that it is on. A new row is one entry in
``mechanical_rows`` or ``electrical_rows`` and a test of what it does; another package adds rows by
the entry-point group ``bodyschema.parameters``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from estimator.errors import EstimatorError
from estimator.parameters.table import Parameter
from estimator.plugins import Registry


@dataclass(frozen=True, kw_only=True)
class PartOutline:
    """What the table must know of a part; a parent, mount or hinge of ``None`` is to be found.

    Attributes:
        name: Name for people.
        parent: Index of the part that it sits on, or ``BASE``.
        mount: Name of the mount that it sits on.
        hinge: Name of its hinge.
        motor: Index of the motor that drives it; ``None``: none does.
        sensor: Index of the touch sensor that it has; ``None``: it has none.
        radius: Half of its thickness, m.
        shape: ``capsule`` or ``box``.
        length: Shortest and longest length, m.
    """

    name: str
    parent: int | None
    mount: str | None
    hinge: str | None
    motor: int | None
    sensor: int | None
    radius: float
    shape: str
    length: tuple[float, float]


RowSource: TypeAlias = Callable[[Sequence[PartOutline], int], Iterable[Parameter]]
"""Makes rows for a robot with these parts and this number of touch sensors."""

SOURCES: Final = Registry[RowSource](
    kind="table of parameters",
    group="bodyschema.parameters",
    own={
        "parts": "estimator.parameters.mechanical_rows:of_parts",
        "main-body": "estimator.parameters.mechanical_rows:of_the_main_body",
        "sensors": "estimator.parameters.electrical_rows:of_sensors",
        "servos": "estimator.parameters.mechanical_rows:of_servos",
        "wiring": "estimator.parameters.electrical_rows:of_wiring",
    },
)


def table_of(parts: Sequence[PartOutline], sensors: int) -> tuple[Parameter, ...]:
    """All rows for a robot with these parts and this number of touch sensors.

    Raises:
        EstimatorError: A package's source gives something else.
    """
    rows = list[Parameter]()
    for name in SOURCES.names():
        source = SOURCES.load(name)
        given: object = source(parts, sensors)
        for row in given if isinstance(given, Iterable) else [given]:
            if not isinstance(row, Parameter):
                raise EstimatorError(
                    f"the {SOURCES.kind} {SOURCES.described(name)} gave {row!r}: it must give "
                    "each Parameter"
                )
            rows.append(row)
    return tuple(rows)


def packages() -> dict[str, str]:
    """Versions, by name, of the packages that add rows."""
    return {
        package: version
        for name in SOURCES.names()
        for package, version in SOURCES.package(name).items()
    }
