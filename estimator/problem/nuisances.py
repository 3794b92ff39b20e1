"""Nuisance parameters: what of a robot is only roughly known besides its body's shape.

They are sampled along with the body, so that what they hide widens the answer instead of bending
it. Each is a gene from 0 to 1, read as a share of its prior: normal, or for the density uniform in
the logarithm.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Protocol

import numpy as np

from estimator.body.morphology import Array
from estimator.problem.sections import NuisanceSection, PartRule

_FARTHEST: Final = 1e-4  # share of a normal prior that is cut off at either end
_FIRST_ZERO: Final = 6  # column


class Prior(Protocol):
    """The distribution of a parameter before the readings; travels to worker processes."""

    def quantile(self, share: Array) -> Array:
        """From shares of the distribution, 0 to 1, to values, SI."""


@dataclass(frozen=True)
class Normal:
    """Around 0, with a standard deviation; the farthest tails cut off."""

    spread: float

    def quantile(self, share: Array) -> Array:
        """See ``Prior``."""
        values: Array = self.spread * _scipy().ndtri(np.clip(share, _FARTHEST, 1 - _FARTHEST))
        return values


@dataclass(frozen=True)
class LogUniform:
    """Uniform in the logarithm."""

    low: float
    high: float

    def quantile(self, share: Array) -> Array:
        """See ``Prior``."""
        values: Array = self.low * (self.high / self.low) ** share
        return values


@dataclass(frozen=True, kw_only=True)
class Nuisance:
    """One parameter.

    Attributes:
        name: For people.
        unit: For people: ``deg``, ``mm`` or ``kg/m³``.
        factor: From SI to that unit.
        column: In the row of all parameters, known ones too: density, centre of mass,
            accelerometer, zeros of all parts.
        prior: Of its values, SI.
    """

    name: str
    unit: str
    factor: float
    column: int
    prior: Prior


class Nuisances:
    """The parameters that a problem leaves open, in the order of their genes.

    Args:
        section: What is open.
        parts: The problem's.
        density: Of the parts where it is not open, kg/m³.

    Attributes:
        listed: The parameters.
    """

    def __init__(self, section: NuisanceSection, parts: Sequence[PartRule], density: float) -> None:
        self._known = np.array([density, *[0.0] * (_FIRST_ZERO - 1 + len(parts))])
        self.listed: tuple[Nuisance, ...] = tuple(_open(section, parts))

    def values(self, genes: Array) -> tuple[Array, Array]:
        """What n points stand for, SI.

        Args:
            genes: Shape (n, parameters), each in [0, 1].

        Returns:
            Density of the parts, then centre of the main body's mass (3) and how its accelerometer
            is turned (2), as in ``Bodies.base``: shape (n, 6); and the angle of each part's hinge
            where its motor stands at 0, shape (n, parts).
        """
        values = np.tile(self._known, (len(genes), 1))
        for one, shares in zip(self.listed, genes.T, strict=True):
            values[:, one.column] = one.prior.quantile(shares)
        return values[:, :_FIRST_ZERO], values[:, _FIRST_ZERO:]


def _open(section: NuisanceSection, parts: Sequence[PartRule]) -> Iterator[Nuisance]:
    if section.density is not None:
        yield Nuisance(
            name="density of the parts",
            unit="kg/m³",
            factor=1.0,
            column=0,
            prior=LogUniform(*section.density),
        )
    millimetres, degrees = ("mm", 1e3), ("deg", math.degrees(1.0))
    centre = [f"main body's centre of mass, {axis}" for axis in ("forward", "left", "up")]
    turns = [f"accelerometer's own tilt, {way}" for way in ("left/right", "forward/back")]
    zeros = {
        _FIRST_ZERO + index: f"zero of the joint of {rule.name}"
        for index, rule in enumerate(parts)
        if rule.motor is not None
    }
    for spread, (unit, factor), names in (
        (section.centre_of_mass_mm, millimetres, dict(enumerate(centre, 1))),
        (section.accelerometer_deg, degrees, dict(enumerate(turns, 4))),
        (section.joint_zero_deg, degrees, zeros),
    ):
        if spread is not None:
            prior = Normal(spread / factor)
            for column, name in names.items():
                yield Nuisance(name=name, unit=unit, factor=factor, column=column, prior=prior)


@cache
def _scipy() -> Any:
    return importlib.import_module("scipy.special")  # other commands do not wait for it
