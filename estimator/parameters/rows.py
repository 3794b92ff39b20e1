"""The table: in what robots differ from their problems, and by how much.

Narrow spreads are those of robots as people build them, wide ones what is noticed only by moving.
Causes that feel the same have one row, whose sentence names both: ground that slopes and an
accelerometer that is turned, a foot and the part that it is on. A new row is one entry in
``mechanical_rows`` or ``electrical_rows`` and a test of what it does; another package adds rows by
the entry-point group ``bodyschema.parameters``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final, Protocol, TypeAlias

from estimator.parameters.table import Parameter
from estimator.plugins import Registry


class PartOutline(Protocol):
    """What the table must know of a part; a parent, mount or hinge of ``None`` is to be found."""

    @property
    def name(self) -> str:
        """Name for people."""

    @property
    def parent(self) -> int | None:
        """Index of the part that it sits on, or ``BASE``."""

    @property
    def mount(self) -> str | None:
        """Name of the mount that it sits on."""

    @property
    def hinge(self) -> str | None:
        """Name of its hinge."""

    @property
    def motor(self) -> int | None:
        """Index of the motor that drives it; ``None``: none does."""

    @property
    def sensor(self) -> int | None:
        """Index of the touch sensor that it has; ``None``: it has none."""

    @property
    def radius(self) -> float:
        """Half of its thickness, m."""

    @property
    def shape(self) -> str:
        """``capsule`` or ``box``."""

    @property
    def length(self) -> tuple[float, float]:
        """Shortest and longest length, m."""


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
    """All rows for a robot with these parts and this number of touch sensors."""
    return tuple(row for name in SOURCES.names() for row in SOURCES.load(name)(parts, sensors))


def packages() -> dict[str, str]:
    """Versions, by name, of the packages that add rows."""
    return {
        package: version
        for name in SOURCES.names()
        for package, version in SOURCES.package(name).items()
    }
