"""Movements that tell changes apart, chosen by the information that they are expected to give."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Bodies
from estimator.body.morphology import Array
from estimator.exploration.best_programs import best_programs
from estimator.exploration.information_gain import InformationGain
from estimator.posterior.fitted import FittedPosterior, each_with_each
from estimator.posterior.posterior import systematic
from estimator.readings.observation import PredictedReadings
from estimator.use.pose import SAFE, attainable
from estimator.use.weighing_changes import ChangeParticles, ChangeWeigher

HYPOTHESES: Final = 160
"""Default number of bodies among which a movement is to tell."""

_CANDIDATES: Final = 300
_DRAWS: Final = 160
_MORE_DRAWS: Final = 640
_UNSAFE: Final = 10.0  # bits that a movement is worth less if it is safe for no body


@dataclass(frozen=True, kw_only=True, eq=False)
class Hypotheses:
    """Equally likely bodies in groups that a movement is to tell apart.

    Attributes:
        bodies: n bodies.
        scales: Logarithms of the bodies' noise factors, shape (n, 2).
        groups: Number of each body's group, shape (n,).
    """

    bodies: Bodies
    scales: Array
    groups: NDArray[np.int64]

    @classmethod
    def of(
        cls,
        weigher: ChangeWeigher,
        groups: Sequence[tuple[ChangeParticles, float]],
        count: int | None = None,
    ) -> Hypotheses:
        """Draws bodies from particles of changes by the changes' shares, in random order.

        Args:
            weigher: Builds the bodies of particles.
            groups: Particles of each group, and its share; shares add up to 1.
            count: Number of bodies; default: ``HYPOTHESES``.
        """
        shares = np.array([share for _, share in groups])
        numbers = np.bincount(
            systematic(shares, count or HYPOTHESES, 0.5), minlength=len(groups)
        ).tolist()
        drawn = [
            (index, particles.drawn(number, 0.5))
            for index, ((particles, _), number) in enumerate(zip(groups, numbers, strict=True))
            if number
        ]
        order = weigher.rng.permutation(sum(numbers))
        return cls(
            bodies=Bodies.joined([weigher.bodies(particles) for _, particles in drawn])[order],
            scales=np.concatenate([weigher.scales(particles) for _, particles in drawn])[order],
            groups=np.repeat([index for index, _ in drawn], [len(one) for _, one in drawn])[order],
        )

    def __len__(self) -> int:
        return len(self.groups)


def best_of(
    weigher: ChangeWeigher, hypotheses: Hypotheses, safe_for: Bodies | None = None
) -> tuple[Array, float]:
    """The movement that tells groups of bodies apart best, rad, and its information, bits.

    Args:
        weigher: Predicts readings.
        hypotheses: The bodies.
        safe_for: Bodies that should not be near falling elsewhere, though most is told there. By
            default a movement is only worth less where bodies are.
    """
    known, rng = weigher.known, weigher.rng
    gain = InformationGain(known.noise, known.clearance_cap, known.modalities)
    low, high = known.program_range.T

    def bits(programs: Array, draws: int, *, margins: bool) -> Array:
        programs = attainable(known, programs)
        predicted = readings_in(known, hypotheses.bodies, programs)
        if margins:
            may_fall = near_forks(known, hypotheses.bodies, programs).ravel()
            predicted = replace(predicted, undecided=predicted.undecided | may_fall)
        groups = hypotheses.groups[:, None]
        information = gain.of(predicted, hypotheses.scales, groups, rng, draws=draws)[:, 0]
        if safe_for is not None:
            information = information - _UNSAFE * near_forks(known, safe_for, programs).mean(axis=1)
        return information

    programs, information = best_programs(
        lambda programs: bits(programs, _DRAWS, margins=False),
        known.program_range,
        rng,
        candidates=rng.uniform(low, high, (_CANDIDATES, len(low))),
        sure=lambda programs: bits(programs, _MORE_DRAWS, margins=True),
        spreads=(math.radians(5.0),),
    )
    return attainable(known, programs[0]), float(information[0])


def readings_in(known: FittedPosterior, bodies: Bodies, programs: Array) -> PredictedReadings:
    """Readings of all bodies in each program, one program after the other."""
    rows, row_programs = each_with_each(len(bodies), programs)
    return known.predictor.read(bodies, rows, row_programs, coarse_step=True)


def near_forks(known: FittedPosterior, bodies: Bodies, programs: Array) -> NDArray[np.bool_]:
    """Which bodies may fall elsewhere in which programs, shape (programs, bodies)."""
    rows, row_programs = each_with_each(len(bodies), programs)
    margins = known.predictor.margins(bodies, rows, row_programs, most=SAFE)
    near: NDArray[np.bool_] = (margins < SAFE - 1e-9).reshape(len(programs), -1)
    return near
