"""The table: what robots have otherwise than their problems say, and by how much.

Narrow spreads are those of robots as people build them, wide ones what is noticed only by moving.
What feels the same has one row, whose sentence names both: ground that slopes and an accelerometer
that is turned, a foot and the part that it is on. A row more is one entry in ``mechanical_rows`` or
``electrical_rows`` and a test of what it does; a package adds some by the entry-point group
``bodyschema.parameters``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final, Protocol, TypeAlias

from estimator.parameters.table import Parameter
from estimator.plugins import Registry


class PartOutline(Protocol):
    """What the table must know of a part; ``None`` stands for what is to be found."""

    @property
    def name(self) -> str:
        """For people."""

    @property
    def parent(self) -> int | None:
        """What it sits on."""

    @property
    def mount(self) -> str | None:
        """Where."""

    @property
    def hinge(self) -> str | None:
        """How its hinge turns it."""

    @property
    def motor(self) -> int | None:
        """The motor that drives it; ``None``: none does."""

    @property
    def sensor(self) -> int | None:
        """The touch sensor that it has."""

    @property
    def radius(self) -> float:
        """Half of its thickness, m."""

    @property
    def shape(self) -> str:
        """``capsule`` or ``box``."""

    @property
    def length(self) -> tuple[float, float]:
        """Its length, m: the least and the most."""


RowSource: TypeAlias = Callable[[Sequence[PartOutline], int], Iterable[Parameter]]
"""Rows for a robot with these parts and so many touch sensors."""

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
    """All rows for a robot with these parts and so many touch sensors."""
    return tuple(row for name in SOURCES.names() for row in SOURCES.load(name)(parts, sensors))


def packages() -> dict[str, str]:
    """Version by name of the packages that add rows."""
    return {
        package: version
        for name in SOURCES.names()
        for package, version in SOURCES.package(name).items()
    }
