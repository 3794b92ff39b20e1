"""What may change on a robot while it is in use: rows of the table, and rows of its legs.

Most are those of ``rows``: a damage is a parameter that is no longer as it was. To these come rows
that mean nothing before lengths are known: a leg that is shorter or longer than it was, and one
that broke off with its gauge.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from estimator.body.morphology import Array, Morphology
from estimator.parameters.rows import table_of
from estimator.parameters.table import Draft, Parameter

GROUPS: Final = frozenset(
    {
        *("servo_dead", "servo_jammed", "servo_plugs", "zero_deg", "travel_of_each"),
        *("gauge_dead", "gauge_stuck", "gauge_plugs"),
        *("hinge_deg", "mount_deg", "mass_of_each", "centre_of_mass_mm"),
        *("accelerometer_deg", "accelerometer_yaw_deg", "distance_mm"),
    }
)
"""Groups of the table of parameters that may change while a robot is in use."""


@dataclass(frozen=True, kw_only=True)
class Within(Parameter):
    """A parameter whose amounts are even between two ends.

    Attributes:
        low: The one.
        high: The other.
        motor: Of the leg.
    """

    low: float
    high: float
    motor: int

    def amounts(self, spread: float, theta: Array) -> Array:
        """Amounts of n standard normal numbers."""
        amounts: Array = self.low + (self.high - self.low) * _normal(theta)
        return amounts


@dataclass(frozen=True, kw_only=True)
class _Outline:
    """A part as the table is told of it."""

    name: str
    parent: int
    mount: str
    hinge: str
    motor: int | None


def changes_of(
    body: Morphology, joints: Sequence[str], parts: Sequence[str]
) -> tuple[Parameter, ...]:
    """All rows for a robot in use.

    Args:
        body: As it was identified.
        joints: Names of its joints, in motor order: parts that are driven are called by them.
        parts: Names of its parts.
    """
    outlines = [
        _Outline(
            name=name if part.motor is None else joints[part.motor],
            parent=part.parent,
            mount=body.mount(index).name,
            hinge=body.hinge(index).name,
            motor=part.motor,
        )
        for index, (part, name) in enumerate(zip(body.parts, parts, strict=True))
    ]
    rows = [row for row in table_of(outlines, body.sensors) if row.group in GROUPS]
    return (*rows, *_lengths(body, joints))


def _lengths(body: Morphology, joints: Sequence[str]) -> Iterator[Parameter]:
    """Legs that are shorter or longer, with a gauge that still feels and without."""
    for root in sorted(set(body.rigid_groups)):
        motor = body.parts[root].motor
        if motor is None:
            continue
        members = [part for part, group in enumerate(body.rigid_groups) if group == root]
        leg = f"the leg of {joints[motor]}"
        for what, group, low, high, change in (
            ("shortened", "length", 0.03, 0.9, partial(_scaled, members)),
            ("lengthened", "longer", 1.1, 1.8, partial(_scaled, members)),
            ("broken off", "broken", 0.03, 0.9, partial(_broken, members)),
        ):
            gauge = ", its gauge gone" if what == "broken off" else ""
            yield Within(
                name=f"{leg} {what}",
                group=group,
                belongs_to="part",
                change=change,
                sentence=f"{leg} {what} to {{}} of its length{gauge}",
                check=f"look at {leg}",
                factor=True,
                wide=1.0,
                low=low,
                high=high,
                motor=motor,
            )


def _scaled(members: list[int], draft: Draft, factors: Array) -> None:
    draft.measures("length")[:, members] *= factors[:, None]


def _broken(members: list[int], draft: Draft, factors: Array) -> None:
    _scaled(members, draft, factors)
    draft.numbers("stuck")[:, members] = -1


def _normal(theta: Array) -> Array:
    """The standard normal distribution function; SciPy's takes as long to load as all else."""
    shares: Array = np.array([0.5 * (1 + math.erf(one / math.sqrt(2))) for one in theta.ravel()])
    return shares.reshape(theta.shape)
