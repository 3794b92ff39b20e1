"""Which samples are observationally equivalent to the attachments of the best body.

A sample is held against the body that has the first mode's attachments and is like it in all else:
a leg that is too short to reach the ground feels the same on any hinge, a longer one does not. Both
are compared as if no servo were dead and no sensor stuck: what such a fault hides is not known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.physics.equivalence import MARGIN, indistinguishable
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.posterior import Mode, Posterior

Indistinguishable: TypeAlias = Callable[[Array, Array], Flags]
"""Whether no sensor discriminates between the bodies of two arrays of n points, pair by pair."""

_COMPARED: Final = 0.002  # probability above which a mode without samples is compared


def indistinguishable_points(
    predictor: Predictor, movements: Array, modalities: Sequence[str], ones: Array, others: Array
) -> Flags:
    """Whether bodies without faults are indistinguishable, pair by pair (``physics.equivalence``).

    Args:
        predictor: Computes readings.
        movements: Motor programs, rad, shape (m, motors).
        modalities: Sensors that may discriminate between bodies.
        ones: Points of the cube, shape (n, size).
        others: Points of the bodies that they are compared with, shape (n, size).

    Returns:
        Whether they are, shape (n,).
    """
    unknowns = predictor.unknowns
    first, second = (unknowns.bodies(unknowns.as_built(points)) for points in (ones, others))
    return indistinguishable(
        lambda rows, programs: predictor.read(first, rows, movements[programs]),
        lambda rows, programs: predictor.read(second, rows, movements[programs]),
        lambda rows, programs: predictor.margins(first, rows, movements[programs], most=2 * MARGIN),
        (len(ones), len(movements)),
        modalities,
    )


def probability_of(
    point: Array, posterior: Posterior, predictor: Predictor, indistinguishable: Indistinguishable
) -> float:
    """Probability of a body's attachments by a posterior, up to what no sensor can tell.

    Args:
        point: The body, shape (size,).
        posterior: Posterior whose samples are compared with bodies like them that have these
            attachments.
        predictor: Knows which columns are attachments.
        indistinguishable: Tests whether bodies are indistinguishable.
    """
    unknowns = predictor.unknowns
    others = _attached_like(point, posterior.values, unknowns)
    (theirs,) = unknowns.keys(point[None])
    same = np.array([key == theirs for key in unknowns.keys(posterior.values)])
    same[~same] = indistinguishable(others[~same], posterior.values[~same])
    return float(posterior.weights @ same)


def indistinguishable_shares(
    modes: Sequence[Mode],
    posterior: Posterior,
    predictor: Predictor,
    indistinguishable: Indistinguishable,
) -> Array:
    """Share of each mode that no sensor can tell from the first mode's attachments.

    Args:
        modes: The first modes of the posterior.
        posterior: Posterior whose samples stand for the modes; for a mode without any its best body
            does.
        predictor: Knows which columns are attachments.
        indistinguishable: Tests whether bodies are indistinguishable.

    Returns:
        Shares from 0 to 1, shape (modes,); 1 for the first mode.
    """
    unknowns = predictor.unknowns
    numbers = {mode.attachments: number for number, mode in enumerate(modes)}
    of_samples = np.array([numbers.get(key, 0) for key in unknowns.keys(posterior.values)])
    rows = np.flatnonzero(of_samples)
    bare = [
        number
        for number, mode in enumerate(modes)
        if number and mode.probability > _COMPARED and number not in of_samples
    ]
    points = np.vstack([posterior.values[rows], *(modes[number].point for number in bare)])
    owners = np.concatenate([of_samples[rows], bare]).astype(np.int64)
    weights = np.concatenate([posterior.weights[rows], np.ones(len(bare))])
    same = indistinguishable(_attached_like(modes[0].point, points, unknowns), points)
    whole = np.bincount(owners, weights, len(modes))
    part = np.bincount(owners, weights * same, len(modes))
    shares = np.divide(part, whole, out=np.zeros(len(modes)), where=whole > 0)
    shares[0] = 1.0
    return shares


def _attached_like(point: Array, values: Array, unknowns: Unknowns) -> Array:
    """The n points of ``values``, with the attachments of ``point``."""
    others = values.copy()
    others[:, unknowns.choices] = point[unknowns.choices]
    return others
