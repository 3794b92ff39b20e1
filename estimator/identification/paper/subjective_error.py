"""The paper's subjective error: how badly a model's readings fit the robot's.

For one interaction::

    e = v + Σ|touch_t − touch_m| + Σ|tilt_t − tilt_m| (degrees) + 10 |clearance_t − clearance_m| (m)

The error over several interactions is the largest of theirs; a pose of the model that is undecided
says nothing and is left out. v is the model's speed at the last step; it stays in the error
whichever modalities are used.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation, PredictedReadings

EXCUSED: Final = 1
"""Interactions in which a body may be undecided: one in five hundred is by chance, so a body that
is undecided twice is built so. A search also finds some that are undecided once and would fit worse
otherwise: docs/statics.md tells how often."""


def interaction_errors(
    readings: PredictedReadings,
    observed: Observation,
    modalities: Collection[str] = tuple(MODALITIES),
) -> Array:
    """Error of each model in one interaction.

    Args:
        readings: Of n models in that interaction.
        observed: What the robot felt.
        modalities: Which sensors count.

    Returns:
        Shape (n,). A missing reading adds nothing. Infinite where the model's reading is invalid,
        so that it never outranks a valid one. 0 where the model's pose is undecided, so that it
        adds nothing to a largest error; see ``largest``.

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


def largest(errors: Array, undecided: Flags) -> Array:
    """The error over several interactions: the largest of those that say something.

    Args:
        errors: Of n models in k interactions, as ``interaction_errors`` gives them, shape (k, n).
        undecided: Whether the model's pose was undecided, shape (k, n).

    Returns:
        Shape (n,). Infinite where nothing is left, and where more than ``EXCUSED`` interactions
        were undecided: a search would otherwise breed bodies that are balanced in all those poses
        which they do not explain.
    """
    worst: Array = np.max(
        np.where(undecided & np.isfinite(errors), 0.0, errors), axis=0, initial=0.0
    )
    excused = min(EXCUSED, len(errors) // 2)
    worst[np.count_nonzero(undecided, axis=0) > excused] = np.inf
    return worst
