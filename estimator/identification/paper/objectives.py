"""Objectives by name: how the errors of single interactions become one figure of a model.

The paper's subjective error of a model in one interaction::

    e = v + Σ|touch_t − touch_m| + Σ|tilt_t − tilt_m| (degrees) + 10 |clearance_t − clearance_m| (m)

Over several interactions it is the largest of their errors; a pose of the model that is undecided
says nothing and is left out. v is the model's speed at the last step; it stays in the error
whichever modalities are used.

An objective of another package belongs to the entry-point group ``bodyschema.objective``: a class
that is constructed with the robot's ``Capabilities``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import MappingProxyType
from typing import Final, Protocol

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.plugins import Registry
from estimator.posterior.model.noise import Noise
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation, PredictedReadings
from protocol.wire.capabilities import Capabilities

EXCUSED: Final = 1
"""Largest number of interactions in which a body may be undecided: one in five hundred is by
chance, so a body that is undecided twice is built so. A search also finds some that are undecided
once and would fit worse otherwise: docs/how-it-works.md tells how often."""


class Objective(Protocol):
    """What the paper's search minimises."""

    def __init__(self, capabilities: Capabilities) -> None: ...

    def terms(
        self, readings: PredictedReadings, observed: Observation, modalities: Sequence[str]
    ) -> Array:
        """Errors of n models in one interaction, shape (n,): ≥ 0, infinite for invalid readings."""

    def lower_bound(self, terms: Array) -> Array:
        """Lower bound of the total, shape (n,): a model whose bound reaches its limit has lost.

        Args:
            terms: Errors of n models in k interactions, shape (k, n); 0 where not yet computed.
        """

    def total(self, terms: Array, undecided: Flags) -> Array:
        """Total error over all interactions, shape (n,).

        Args:
            terms: Errors of n models in k interactions, shape (k, n).
            undecided: Whether a model's pose might as well be another, shape (k, n).
        """


class LargestError:
    """The paper's objective: the largest error over the interactions, for any robot.

    A subclass with a ``total`` of its own inherits the right ``lower_bound`` if its total of errors
    that are at least 0 only grows.
    """

    def __init__(self, capabilities: Capabilities | None = None) -> None:
        del capabilities

    def terms(
        self, readings: PredictedReadings, observed: Observation, modalities: Sequence[str]
    ) -> Array:
        """The paper's subjective error of each model in one interaction.

        Returns:
            Errors, shape (n,). A missing reading adds nothing. Infinite where the model's reading
            is invalid, so that it never outranks a valid one. 0 where the model's pose is
            undecided, so that it adds nothing to a largest error.

        Raises:
            EstimatorError: Robot and models have different numbers of touch sensors.
        """
        error = readings.speed.copy()
        for name, modality in MODALITIES.items():
            if name in modalities:
                error += modality.error(readings, observed)
        error[readings.undecided] = 0.0
        errors: Array = np.where(readings.valid & ~np.isnan(error), error, np.inf)
        return errors

    def lower_bound(self, terms: Array) -> Array:
        """Total over the interactions so far."""
        return self.total(terms, np.zeros(terms.shape, dtype=bool))

    def total(self, terms: Array, undecided: Flags) -> Array:
        """Largest error over the interactions in which the model is decided.

        Returns:
            Errors, shape (n,). Infinite where nothing is left, and where more than ``EXCUSED``
            interactions were undecided: a search would otherwise breed bodies that are balanced in
            all those poses which they do not explain.
        """
        decided = np.where(undecided & np.isfinite(terms), 0.0, terms)
        worst: Array = np.max(decided, axis=0, initial=0.0)
        excused = min(EXCUSED, len(terms) // 2)
        worst[np.count_nonzero(undecided, axis=0) > excused] = np.inf
        return worst


class RobustMeanError:
    """Mean over interactions of log(1 + capped error in units of noise), summed over the senses.

    One pose in which a model lands elsewhere than the robot does cannot veto the model.
    """

    _CAP: Final = 20.0  # standard deviations: more is no worse
    _TOUCH: Final = 0.1  # what a differing bit is divided by, as if it were a standard deviation

    def __init__(self, capabilities: Capabilities) -> None:
        noise = Noise.announced(capabilities)
        self._scales = {
            "touch": self._TOUCH,
            "tilt": math.degrees(noise.tilt),
            "clearance": 10.0 * noise.clearance,  # the paper's weight
        }

    def terms(
        self, readings: PredictedReadings, observed: Observation, modalities: Sequence[str]
    ) -> Array:
        """Sum over the senses for each model in one interaction, shape (n,)."""
        total: Array = np.zeros(len(readings))
        for name, modality in MODALITIES.items():
            if name in modalities:
                error = modality.error(readings, observed) / self._scales[name]
                total += np.log1p(np.minimum(error, self._CAP))
        total[readings.undecided] = len(modalities) * math.log1p(self._CAP)
        errors: Array = np.where(readings.valid & ~np.isnan(total), total, np.inf)
        return errors

    def lower_bound(self, terms: Array) -> Array:
        """Mean if the model were perfect in all interactions that are still to come."""
        mean: Array = np.mean(terms, axis=0)
        return mean

    def total(self, terms: Array, undecided: Flags) -> Array:
        """Mean over the interactions; an undecided pose counts as the worst."""
        del undecided
        return self.lower_bound(terms)


OBJECTIVES: Final[Registry[type[Objective]]] = Registry(
    kind="objective",
    group="bodyschema.objective",
    own=MappingProxyType(
        {
            "largest": "estimator.identification.paper.objectives:LargestError",
            "robust-mean": "estimator.identification.paper.objectives:RobustMeanError",
        }
    ),
)
