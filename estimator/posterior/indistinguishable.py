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

_LEAST_PROBABILITY: Final = 0.002  # probability above which a mode without samples is compared


def indistinguishable_points(
    predictor: Predictor, movements: Array, modalities: Sequence[str], ones: Array, others: Array
) -> Flags:
    """Whether bodies without faults are indistinguishable (``physics.equivalence``), shape (n,).

    Args:
        predictor: Computes readings.
        movements: Motor programs, rad, shape (m, motors).
        modalities: Sensors that may discriminate between bodies.
        ones: Points of the cube, shape (n, size).
        others: Points of the bodies that they are compared with, pair by pair, shape (n, size).
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
    attached = _attached_like(point, posterior.values, unknowns)
    (attachments,) = unknowns.keys(point[None])
    same = np.array([key == attachments for key in unknowns.keys(posterior.values)])
    same[~same] = indistinguishable(attached[~same], posterior.values[~same])
    return float(posterior.weights @ same)


def indistinguishable_shares(
    modes: Sequence[Mode],
    posterior: Posterior,
    predictor: Predictor,
    indistinguishable: Indistinguishable,
) -> Array:
    """Share of each mode that no sensor can tell from the first mode's attachments, shape (modes,).

    Args:
        modes: The first modes of the posterior; the share of the very first is 1.
        posterior: Posterior whose samples stand for the modes; for a mode without any its best body
            does.
        predictor: Knows which columns are attachments.
        indistinguishable: Tests whether bodies are indistinguishable.
    """
    unknowns = predictor.unknowns
    numbers = {mode.attachments: number for number, mode in enumerate(modes)}
    of_samples = np.array([numbers.get(key, 0) for key in unknowns.keys(posterior.values)])
    rows = np.flatnonzero(of_samples)
    unsampled = [
        number
        for number, mode in enumerate(modes)
        if number and mode.probability > _LEAST_PROBABILITY and number not in of_samples
    ]
    points = np.vstack([posterior.values[rows], *(modes[number].point for number in unsampled)])
    owners = np.concatenate([of_samples[rows], unsampled]).astype(np.int64)
    weights = np.concatenate([posterior.weights[rows], np.ones(len(unsampled))])
    same = indistinguishable(_attached_like(modes[0].point, points, unknowns), points)
    total = np.bincount(owners, weights, len(modes))
    equivalent = np.bincount(owners, weights * same, len(modes))
    shares = np.divide(equivalent, total, out=np.zeros(len(modes)), where=total > 0)
    shares[0] = 1.0
    return shares


def _attached_like(point: Array, values: Array, unknowns: Unknowns) -> Array:
    """The n points of ``values``, with the attachments of ``point``."""
    attached = values.copy()
    attached[:, unknowns.choices] = point[unknowns.choices]
    return attached
