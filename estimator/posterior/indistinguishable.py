"""Which samples are observationally equivalent to the attachments of the best body.

A sample is held against the body that has its lengths and the first mode's attachments: a leg that
is too short to reach the ground feels the same on any hinge, a longer one does not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.physics.equivalence import AGREEMENT, MARGIN, agree
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Mode, Posterior

Indistinguishable: TypeAlias = Callable[[Array, Array], Flags]
"""Of two arrays of n points, whether body by body no sensor discriminates between them."""

_FIRST: Final = 50  # movements, in which nearly all bodies differ already that differ at all
_COMPARED: Final = 0.002  # probability of a mode that is compared


def indistinguishable(
    predictor: Predictor,
    movements: Array,
    modalities: Sequence[str],
    ones: Array,
    others: Array,
) -> Flags:
    """Compares bodies pair by pair, as ``physics.equivalence.Reference`` does one with many.

    Args:
        predictor: Computes readings.
        movements: Motor programs, rad, shape (m, motors).
        modalities: Sensors that may tell bodies apart.
        ones: Points of the cube, shape (n, size).
        others: Points of the cube, shape (n, size).

    Returns:
        Shape (n,): whether two bodies read alike in (nearly) all movements in which no trifle
        decides.
    """
    bodies = [predictor.unknowns.bodies(points) for points in (ones, others)]
    allowed = int((1 - AGREEMENT) * len(movements))
    differing = np.zeros(len(ones), dtype=np.int64)
    for some in (movements[:_FIRST], movements[_FIRST:]):
        left = np.flatnonzero(differing <= allowed)
        rows, programs = np.repeat(left, len(some)), np.tile(some, (len(left), 1))
        one, other = (predictor.read(each, rows, programs) for each in bodies)
        differ = ~agree(one, other, modalities).reshape(len(left), len(some))
        # Margins cost as much as many readings; twice as many as are allowed will do.
        asked = np.flatnonzero(differ & (np.cumsum(differ, axis=1) <= 2 * (allowed + 1)))
        tells = np.zeros(differ.size, dtype=bool)
        margins = predictor.margins(bodies[0], rows[asked], programs[asked], most=2 * MARGIN)
        tells[asked] = margins > MARGIN
        differing[left] += tells.reshape(differ.shape).sum(axis=1)
    return np.asarray(differing <= allowed)


def probability_of(
    point: Array, posterior: Posterior, predictor: Predictor, alike: Indistinguishable
) -> float:
    """How probable a body's attachments are by a posterior, up to what no sensor can tell.

    Args:
        point: The body, shape (size,).
        posterior: Its samples are held against bodies of their lengths with these attachments.
        predictor: Knows which columns are lengths.
        alike: The test.
    """
    unknowns = predictor.unknowns
    others = np.tile(point, (len(posterior.values), 1))
    others[:, unknowns.continuous] = posterior.values[:, unknowns.continuous]
    (theirs,) = unknowns.keys(point[None])
    same = np.array([key == theirs for key in unknowns.keys(posterior.values)])
    same[~same] = alike(others[~same], posterior.values[~same])
    return float(posterior.weights @ same)


def indistinguishable_shares(
    modes: Sequence[Mode], posterior: Posterior, predictor: Predictor, alike: Indistinguishable
) -> Array:
    """How much of each mode no sensor can tell from the first mode's attachments.

    Args:
        modes: The first of the posterior's.
        posterior: Has the samples that stand for each mode; of a mode without any its best body
            stands for it.
        predictor: Knows which columns are lengths.
        alike: The test.

    Returns:
        From 0 to 1, shape (modes,); 1 for the first.
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
    shares = np.zeros(len(modes))
    shares[0] = 1.0
    if not len(points):
        return shares
    others = np.tile(modes[0].point, (len(points), 1))
    others[:, unknowns.continuous] = points[:, unknowns.continuous]
    same = alike(others, points)
    whole = np.bincount(owners, weights, len(modes))
    part = np.bincount(owners, weights * same, len(modes))
    np.divide(part, whole, out=shares, where=whole > 0)
    shares[0] = 1.0
    return shares
