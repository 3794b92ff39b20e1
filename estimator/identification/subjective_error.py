"""The paper's subjective error: how badly a model's readings fit the robot's.

For one interaction::

    e = v + Σ|touch_t − touch_m| + Σ|tilt_t − tilt_m| (degrees) + 10 |clearance_t − clearance_m| (m)

The error over several interactions is the largest of theirs; a pose of the model that is undecided
says nothing and is left out. v is the model's speed at the last step; it stays in the error
whichever modalities are used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.errors import EstimatorError
from estimator.physics.base import Flags, Readings
from estimator.readings.observation import ObservedReadings

MODALITIES: Final = ("touch", "tilt", "clearance")
CLEARANCE_WEIGHT: Final = 10.0  # the paper's
EXCUSED: Final = 1
"""Interactions in which a body may be undecided: one in five hundred is by accident, so a body that
is undecided twice is built so. A search also finds some that are undecided once and would fit worse
otherwise: docs/statics.md tells how often."""


def check_modalities(names: Sequence[str]) -> tuple[str, ...]:
    """The modalities in their usual order.

    Raises:
        EstimatorError: One is unknown, or there is none.
    """
    unknown = sorted(set(names) - set(MODALITIES))
    if unknown or not names:
        raise EstimatorError(
            f"modalities must be one or more of {', '.join(MODALITIES)}, "
            f"not {', '.join(unknown) or 'none'}"
        )
    return tuple(name for name in MODALITIES if name in names)


def interaction_errors(
    readings: Readings, observed: ObservedReadings, modalities: Sequence[str] = MODALITIES
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
    if "touch" in modalities:
        if readings.touch.shape[1] != len(observed.touch):
            raise EstimatorError(
                f"the robot has {len(observed.touch)} touch sensors but the problem describes "
                f"{readings.touch.shape[1]}: correct the problem file or leave touch out"
            )
        error += np.nansum(np.abs(observed.touch - readings.touch), axis=1)
    if "tilt" in modalities:
        error += np.nansum(np.degrees(np.abs(observed.tilt - readings.tilt)), axis=1)
    if "clearance" in modalities and not math.isnan(observed.clearance):
        error += CLEARANCE_WEIGHT * np.abs(observed.clearance - readings.clearance)
    error[readings.undecided] = 0.0
    found: Array = np.where(readings.valid & ~np.isnan(error), error, np.inf)
    return found


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
    found: Array = np.max(
        np.where(undecided & np.isfinite(errors), 0.0, errors), axis=0, initial=0.0
    )
    excused = min(EXCUSED, len(errors) // 2)
    found[np.count_nonzero(undecided, axis=0) > excused] = np.inf
    return found
