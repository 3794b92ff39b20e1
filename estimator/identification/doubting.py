"""Bodies that depart from a run's problem: when they are looked for, and what they take."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.limbs import leg_lengths
from estimator.body.morphology import Array
from estimator.physics.base import Physics
from estimator.posterior.checks.departed import (
    clearly_better,
    doubts,
    outliers_left,
    probability_departed,
    that_can_be_felt,
    with_consequence,
)
from estimator.posterior.information import systematic
from estimator.posterior.model.departures import Doubt
from estimator.posterior.model.likelihood import Noise
from estimator.posterior.model.possible_departures import possible_departures
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Posterior
from estimator.storage.beliefs import Belief, NotKnown
from estimator.storage.store import RunStore

SURE: Final = 0.95
"""Attachments are known when they are stated to be so probable."""

_FEW: Final = 100  # movements, in which a departure shows if it can be felt at all


def attachments_known(belief: Belief, wanted: float, store: RunStore) -> bool:
    """Whether a run is so sure of attachments, and stands by them."""
    contradicted = store.problem.contradictions(store.capabilities)
    return (belief.probability or 0.0) >= wanted and belief.explained and not contradicted


@dataclass(frozen=True, kw_only=True)
class Grounds:
    """What a belief rests on.

    Attributes:
        posterior: Of the problem's bodies.
        predictor: Of their readings.
        data: What the robot felt.
        reference: The simulator.
    """

    posterior: Posterior
    predictor: Predictor
    data: SensorData
    reference: Physics


class Doubting:
    """Fits bodies that depart from a run's problem, and says what they leave of a belief.

    Args:
        store: The run.
        noise: How far readings stray.
        movements: At random, rad, shape (n, motors).
        workers: Fit them.
    """

    def __init__(self, store: RunStore, noise: Noise, movements: Array, workers: Executor) -> None:
        self._store = store
        self._noise = noise
        self._movements = movements[:_FEW]
        self._workers = workers

    def once_sure(self, belief: Belief, grounds: Grounds) -> tuple[Doubt, ...]:
        """Bodies that depart, where attachments are known, beforehand or by now; else none."""
        # that a robot has changed is a reason to look how
        as_stated = belief.model_copy(
            update={"departed": 0.0, "departure": None, "overturned": None}
        )
        if grounds.predictor.unknowns.bits and not attachments_known(as_stated, SURE, self._store):
            return ()
        return self._fitted(grounds, self._noise)

    def in_the_end(self, belief: Belief, grounds: Grounds) -> tuple[Doubt, ...]:
        """Bodies that depart, whatever is known."""
        return self._fitted(grounds, self._noise_for(belief, grounds))

    def _fitted(self, grounds: Grounds, noise: Noise) -> tuple[Doubt, ...]:
        posterior, predictor, settings = grounds.posterior, grounds.predictor, self._store.settings
        departures = that_can_be_felt(
            possible_departures(self._store.problem),
            posterior.modes[0].point,
            predictor,
            self._movements,
            settings.modalities,
        )
        return doubts(
            posterior,
            predictor,
            grounds.data,
            noise,
            departures,
            reference=grounds.reference,
            workers=self._workers,
        )

    def _noise_for(self, belief: Belief, grounds: Grounds) -> Noise:
        """As announced, or as sampled along where attachments are open and the best fits poorly.

        By announced noise readings of a noisier robot would speak for bodies that depart.
        """
        if not grounds.predictor.unknowns.bits or belief.not_known is not NotKnown.POOR_FIT:
            return self._noise
        return self._noise.widened(np.exp(np.array(belief.weights) @ np.array(belief.scales)))

    def left_of(self, belief: Belief, doubted: Sequence[Doubt], grounds: Grounds) -> Belief:
        """What is believed, in the light of bodies that depart."""
        if not doubted:
            return belief
        by_statics = np.array([one.outlier for one in belief.foretold])
        outliers = outliers_left(
            by_statics,
            grounds.posterior,
            grounds.predictor,
            grounds.data,
            self._noise_for(belief, grounds),
            reference=grounds.reference,
        )
        better = clearly_better(doubted)
        return belief.model_copy(
            update={
                "departed": probability_departed(doubted, outliers, self._noise),
                "departure": None if better is None else better.name,
            }
        )

    def untested(self, doubted: Sequence[Doubt], posterior: Posterior) -> tuple[str, ...]:
        """Which departures the readings leave, and what they would mean for the lengths."""
        decode_all = self._store.genome.decode_all
        rows = systematic(posterior.weights, len(posterior.values), 0.5)
        believed = leg_lengths(decode_all(posterior.values[rows]))
        return tuple(
            with_consequence(one.departure, leg_lengths(decode_all(one.point[None]))[0], believed)
            for one in doubted
            if one.is_left
        )
