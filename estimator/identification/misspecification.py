"""The misspecification check of a run: when bodies that deviate from its problem are fitted."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from typing import Final

import numpy as np

from estimator.body.limbs import leg_lengths
from estimator.body.morphology import Array
from estimator.physics.base import Physics
from estimator.posterior.checks.misspecification import (
    clearly_better,
    fit_alternatives,
    observable_deviations,
    outliers_left,
    probability_misspecified,
    with_consequence,
)
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.model.deviations import Alternative, possible_deviations
from estimator.posterior.model.likelihood import Noise
from estimator.posterior.posterior import Posterior, systematic
from estimator.storage.posteriors import NotKnown, StoredPosterior
from estimator.storage.store import RunStore

SURE: Final = 0.95
"""Attachments are known when they are stated to be so probable."""

_FEW: Final = 100  # movements, in which a deviation shows if it can be observed at all


def attachments_known(summary: StoredPosterior, wanted: float, store: RunStore) -> bool:
    """Whether a run is so sure of attachments, and stands by them."""
    contradicted = store.problem.contradictions(store.capabilities)
    return (summary.probability or 0.0) >= wanted and summary.explained and not contradicted


class MisspecificationCheck:
    """Fits bodies that deviate from a run's problem, and weighs them against the posterior.

    Args:
        store: The run.
        movements: At random, rad, shape (n, motors).
        workers: Fit them.
    """

    def __init__(self, store: RunStore, movements: Array, workers: Executor) -> None:
        self._store = store
        self._movements = movements[:_FEW]
        self._workers = workers

    def once_sure(
        self, summary: StoredPosterior, fitted: FittedPosterior, reference: Physics
    ) -> tuple[Alternative, ...]:
        """Alternative hypotheses, where attachments are known, beforehand or by now; else none.

        Args:
            summary: The summary so far.
            fitted: Of the problem's bodies.
            reference: The simulator.
        """
        # that a robot has changed is a reason to look how
        as_stated = summary.model_copy(
            update={"misspecification_probability": 0.0, "deviation": None, "overturned": None}
        )
        if fitted.unknowns.bits and not attachments_known(as_stated, SURE, self._store):
            return ()
        return self._deviating(fitted, reference, fitted.noise)

    def in_the_end(
        self, summary: StoredPosterior, fitted: FittedPosterior, reference: Physics
    ) -> tuple[Alternative, ...]:
        """Alternative hypotheses at the end of a run, whatever is known."""
        return self._deviating(fitted, reference, self._noise_for(summary, fitted))

    def _deviating(
        self, fitted: FittedPosterior, reference: Physics, noise: Noise
    ) -> tuple[Alternative, ...]:
        posterior, predictor = fitted.posterior, fitted.predictor
        deviations = observable_deviations(
            possible_deviations(fitted.problem),
            posterior.modes[0].point,
            predictor,
            self._movements,
            fitted.modalities,
        )
        return fit_alternatives(
            posterior,
            predictor,
            fitted.data,
            noise,
            deviations,
            reference=reference,
            workers=self._workers,
        )

    def _noise_for(self, summary: StoredPosterior, fitted: FittedPosterior) -> Noise:
        """As announced, or as sampled along where attachments are open and the best fits poorly.

        By announced noise readings of a noisier robot would speak for bodies that deviate.
        """
        if not fitted.unknowns.bits or summary.not_known is not NotKnown.POOR_FIT:
            return fitted.noise
        return fitted.noise.widened(np.exp(np.array(summary.weights) @ np.array(summary.scales)))

    def left_of(
        self,
        summary: StoredPosterior,
        alternatives: Sequence[Alternative],
        fitted: FittedPosterior,
        reference: Physics,
    ) -> StoredPosterior:
        """The summary, with the probability that the robot deviates from the problem."""
        if not alternatives:
            return summary
        by_statics = np.array([one.outlier_probability for one in summary.predicted])
        outliers = outliers_left(
            by_statics,
            fitted.posterior,
            fitted.predictor,
            fitted.data,
            self._noise_for(summary, fitted),
            reference=reference,
        )
        better = clearly_better(alternatives)
        return summary.model_copy(
            update={
                "misspecification_probability": probability_misspecified(
                    alternatives, outliers, fitted.noise
                ),
                "deviation": None if better is None else better.name,
            }
        )

    def untested(
        self, alternatives: Sequence[Alternative], posterior: Posterior
    ) -> tuple[str, ...]:
        """Which deviations the readings leave, and what they would mean for the lengths."""
        decode_all = self._store.genome.decode_all
        rows = systematic(posterior.weights, len(posterior.values), 0.5)
        summarised = leg_lengths(decode_all(posterior.values[rows]))
        return tuple(
            with_consequence(one.deviation, leg_lengths(decode_all(one.point[None]))[0], summarised)
            for one in alternatives
            if one.is_left
        )
