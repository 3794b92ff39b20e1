"""What may change on a robot while it is in use: rows of the table, and rows of its legs.

Most are those of ``rows``: a damage is a parameter that is no longer as it was. To these come rows
that mean nothing before lengths are known: a leg that is shorter or longer than it was, and one
that broke off with its gauge. What broke ends in an edge, and so reaches some millimetres less far
than a leg with a round foot that lifts its robot as high.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from estimator.body.morphology import BASE, Array, Morphology
from estimator.parameters.mechanical_rows import STUB
from estimator.parameters.rows import PartOutline, table_of
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

_THICKER: Final = 2.0  # thickness of a leg above its foot, as a factor on what problems state


@dataclass(frozen=True, kw_only=True)
class LegLength(Parameter):
    """The length of a leg that is shorter or longer than it was.

    Amounts are shares of the length that the leg had, uniformly distributed between two ends;
    negative: it ends in an edge.

    Attributes:
        low: Smallest share.
        high: Largest share.
        motor: Motor of the leg.
    """

    low: float
    high: float
    motor: int

    @property
    def is_centred(self) -> bool:
        """It is not: all shares between the two ends are equally probable."""
        return False

    def amounts(self, spread: float, theta: Array) -> Array:
        """Shares for n standard normal numbers; for negative ones the leg ends in an edge."""
        places = 2 * _normal(np.abs(theta)) - 1
        return np.copysign(self.low + (self.high - self.low) * places, theta)

    def as_told(self, amounts: Array) -> Array:
        """The shares, whatever the leg ends in."""
        return np.abs(amounts)


def changeable_rows_of(
    body: Morphology, joints: Sequence[str], parts: Sequence[str]
) -> tuple[Parameter, ...]:
    """All rows for a robot in use.

    Args:
        body: The body as it was identified.
        joints: Names of its joints, in motor order: parts that are driven are called by them.
        parts: Names of its parts.
    """
    outlines = [
        PartOutline(
            name=name if part.motor is None else joints[part.motor],
            parent=part.parent,
            mount=body.mount(index).name,
            hinge=body.hinge(index).name,
            motor=part.motor,
            sensor=part.sensor,
            radius=part.radius,
            shape=part.shape,
            length=(part.length, part.length),
        )
        for index, (part, name) in enumerate(zip(body.parts, parts, strict=True))
    ]
    rows = [row for row in table_of(outlines, body.sensors) if row.group in GROUPS]
    return (*rows, *_lengths(body, joints))


def _lengths(body: Morphology, joints: Sequence[str]) -> Iterator[Parameter]:
    """Rows for legs that are shorter or longer, with a gauge that still works or without."""
    for root in sorted(set(body.rigid_groups)):
        motor = body.parts[root].motor
        if motor is None:
            continue
        members = [part for part, group in enumerate(body.rigid_groups) if group == root]
        carried = [part for part in range(len(body.parts)) if _sits_on(body, part, members)]
        leg = f"the leg of {joints[motor]}"
        for damage, group, low, high, change in (
            ("shortened", "length", 0.03, 0.9, partial(_shortened, members)),
            ("lengthened", "longer", 1.1, 1.8, partial(_scaled, members)),
            ("broken off", "broken", 0.03, 0.9, partial(_broken, members, carried)),
        ):
            gauge = ", its gauge gone" if damage == "broken off" else ""
            yield LegLength(
                name=f"{leg} {damage}",
                group=group,
                change=change,
                sentence=f"{leg} {damage} to {{}} of its length{gauge}",
                check=f"look at {leg}",
                factor=True,
                wide=1.0,
                low=low,
                high=high,
                motor=motor,
            )


def _scaled(members: list[int], draft: Draft, shares: Array) -> None:
    draft.measures("length")[:, members] *= np.abs(shares)[:, None]


def _shortened(members: list[int], draft: Draft, shares: Array) -> None:
    """Shortens legs; a bar of the same cross-section stands for one that ends in an edge."""
    _scaled(members, draft, shares)
    edged = np.flatnonzero(shares < 0)[:, None], members
    draft.measures("radius")[edged] *= math.sqrt(math.pi) / 2
    draft.flags("box")[edged] = True


def _sits_on(body: Morphology, part: int, members: Collection[int]) -> bool:
    """Whether a part sits on one of some others, or on what these carry."""
    parent = body.parts[part].parent
    below = parent in members or (parent != BASE and _sits_on(body, parent, members))
    return below and part not in members


def _broken(members: list[int], carried: list[int], draft: Draft, shares: Array) -> None:
    """Breaks legs off with all that they carry.

    For positive shares the stump is as thick as a leg may be above its foot.
    """
    _shortened(members, draft, -np.abs(shares))
    thick = np.flatnonzero(shares > 0)[:, None], members
    draft.measures("radius")[thick] *= _THICKER
    draft.measures("density")[thick] /= _THICKER**2
    draft.measures("length")[:, carried] *= STUB
    draft.numbers("stuck")[:, [*members, *carried]] = -1


def _normal(theta: Array) -> Array:
    """The standard normal distribution function; SciPy's takes as long to load as all else."""
    shares: Array = np.array([0.5 * (1 + math.erf(z / math.sqrt(2))) for z in theta.ravel()])
    return shares.reshape(theta.shape)
