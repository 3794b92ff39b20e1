"""Whether the populations agree on what they have found, and whether that can be all.

They are independent, so what both have found tells how much neither has.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.checks.verdict import POOR, Fit, fit_of
from estimator.posterior.discovery.discovery import BestPoints
from estimator.posterior.model.likelihood import Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.special import softmax
from estimator.posterior.model.unknowns import Attachments, Predictor, Unknowns
from estimator.posterior.posterior import coverage, found_by_each
from estimator.posterior.sampling.evidence import EvidenceEstimator
from estimator.storage.beliefs import OUTLIERS

CONSIDERED: Final = 16.0
"""Nats below the best fit, which may be a mere spike."""

ENOUGH_TO_ERR: Final = 5
"""Interactions, of which one may be left unexplained."""

_AS_GOOD: Final = 3.0  # nats that the lengths which a population found may fit worse
_AS_PROBABLE: Final = 3.0  # nats
_BAD: Final = 2.33  # excess, as one right body of a hundred has
_FEW: Final = 50  # sets of attachments that all populations can have found


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """What the populations have found, side by side, and how far they agree.

    Attributes:
        points: The best of each set of attachments that may matter, best first, shape (n, size).
        keys: Their attachments.
        best: Log-likelihood of the first.
        guesses: Of their evidences, shape (n,).
        found: Which of their attachments each population has found, and explained as well.
        fit: How well the leader, which is the most probable by those guesses, explains the
            readings.
        may_err: Whether there are so many readings that one may be left unexplained.
    """

    points: Array
    keys: list[Attachments]
    best: float
    guesses: Array
    found: Sequence[Collection[Attachments]]
    fit: Fit
    may_err: bool

    @classmethod
    def of(
        cls,
        bodies: Sequence[BestPoints],
        predictor: Predictor,
        estimator: EvidenceEstimator,
        data: SensorData,
        noise: Noise,
    ) -> Self:
        """Compares.

        Args:
            bodies: What each population has found.
            predictor: Computes readings.
            estimator: Guesses evidences.
            data: The observations.
            noise: Sensor noise.
        """
        unknowns = predictor.unknowns
        together = BestPoints.joined(bodies, unknowns)
        best = float(together.fits[0])
        points = together.values[together.fits > best - CONSIDERED]
        guesses = estimator.guess(points)
        return cls(
            points=points,
            keys=unknowns.keys(points),
            best=best,
            guesses=guesses,
            found=[attachments_found(one, points, estimator, unknowns) for one in bodies],
            fit=fit_of(points[int(np.argmax(guesses))], predictor, data, noise),
            may_err=len(data) >= ENOUGH_TO_ERR,
        )

    @property
    def leader(self) -> Attachments:
        """The most probable attachments."""
        return self.keys[int(np.argmax(self.guesses))]

    @property
    def leads(self) -> bool:
        """Whether the leader's attachments are more probable than all others together."""
        return bool(softmax(self.guesses).max() > 0.5)

    @property
    def leaders(self) -> list[Attachments]:
        """Attachments about as probable as the leader's, as those that feel alike are."""
        rows = np.flatnonzero(self.guesses > self.guesses.max() - _AS_PROBABLE)
        return [self.keys[row] for row in rows]

    @property
    def explained(self) -> bool:
        """Whether the leader leaves no more unexplained than outliers are."""
        return self.fit.unexplained <= OUTLIERS

    @property
    def explains_too_little(self) -> bool:
        """Whether the leader leaves more unexplained than a right body may, of so few or many."""
        return self.fit.unexplained > (OUTLIERS if self.may_err else 0)

    @property
    def improvable(self) -> bool:
        """Whether the fit is so poor that a better body may exist."""
        return self.fit.is_improvable

    @property
    def adequate_fit(self) -> bool:
        """Whether the readings are explained so well that something can be certain.

        One interaction may be an outlier, but not where the others are explained poorly too: two
        outliers lead to a body that explains all of them, none well. Where attachments are known
        no other body can explain them better, and what is explained badly alone counts.
        """
        any_other = bool(self.leader)
        outlier = self.fit.unexplained > 0
        limit = POOR if any_other and (outlier or not self.may_err) else _BAD
        return not self.explains_too_little and self.fit.excess <= limit

    @property
    def few(self) -> bool:
        """Whether all that matters is so little that every population can have found it."""
        return bool(np.sum(softmax(self.guesses) ** 2) > 1 / _FEW)

    @property
    def coverage(self) -> float:
        """How much of the posterior the populations have found."""
        return coverage(softmax(self.guesses), found_by_each(self.keys, self.found))

    def share_beyond(self, known: Collection[Attachments]) -> float:
        """The share of the posterior that attachments have which were not known before."""
        shares = softmax(self.guesses)
        return float(sum(shares[row] for row, key in enumerate(self.keys) if key not in known))


def attachments_found(
    bodies: BestPoints, points: Array, estimator: EvidenceEstimator, unknowns: Unknowns
) -> set[Attachments]:
    """Which sets of attachments a population has found with lengths about as good as are known.

    Args:
        bodies: All that it found.
        points: The best of each set that may matter, by any population.
        estimator: Knows how well points fit.
        unknowns: Of the problem.
    """
    keys = unknowns.keys(bodies.values)
    if not unknowns.choices.size:
        return set(keys)  # all have the same
    best = dict(zip(unknowns.keys(points), estimator.fits(points).tolist(), strict=True))
    rows = [row for row, key in enumerate(keys) if key in best]
    fits = estimator.fits(bodies.values[rows])
    return {
        keys[row] for row, fit in zip(rows, fits, strict=True) if fit > best[keys[row]] - _AS_GOOD
    }
