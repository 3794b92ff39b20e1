"""Many points ranked by how well they fit, most of them by a few interactions only."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.gauss_newton import GaussNewton, best_of_each
from estimator.posterior.model.unknowns import Unknowns

_TRIED_FIRST: Final = 2  # interactions; with this share
_GO_ON: Final = 0.25  # of the points, as many more are tried, and so on
_EXPLAINING: Final = 0.1  # of the points, where one is tried first that has to be explained
_FEWEST: Final = 200  # points that go on
_SAMPLED: Final = 0.05  # of the points, which tell in which interactions they differ


def ranked(
    points: Array, solver: GaussNewton, rng: np.random.Generator, unexplained: Sequence[int] = ()
) -> Array:
    """The points that fit best while the noise is wide, best first; unlikely ones are left out.

    Interactions in which the points differ as much as usual are tried first, the others with
    those alone that fit best in these. Where they differ most bodies fall to one side or the
    other, whatever their solver, and the right choices do not stand out.

    Args:
        points: Shape (n, size).
        solver: Compares them.
        rng: Draws those that tell in which interactions they differ.
        unexplained: Interactions that a point has to explain to be any better than what is known:
            these are tried first, if there are any.
    """
    interactions = np.arange(solver.interactions)
    if len(points) <= _FEWEST or interactions.size <= _TRIED_FIRST:
        fits = solver.rough_fits(points, interactions).sum(axis=1)
        return points[np.argsort(-fits, kind="stable")]
    if len(unexplained):
        order = np.concatenate([unexplained, np.setdiff1d(interactions, unexplained)])
        tried, share = 1, _EXPLAINING
    else:
        sample = rng.choice(len(points), round(_SAMPLED * len(points)), replace=False)
        spread = solver.rough_fits(points[sample], interactions).std(axis=0)
        order = np.argsort(np.abs(spread - np.median(spread)), kind="stable")
        tried, share = _TRIED_FIRST, _GO_ON
    fits = solver.rough_fits(points, order[:tried]).sum(axis=1)
    while tried < order.size:
        best = np.argsort(-fits, kind="stable")[: max(_FEWEST, round(share * len(points)))]
        points = points[best]
        fits = fits[best] + solver.rough_fits(points, order[tried : 2 * tried]).sum(axis=1)
        tried *= 2
    return points[np.argsort(-fits, kind="stable")]


def ranked_by_attachments(
    points: Array,
    solver: GaussNewton,
    unknowns: Unknowns,
    rng: np.random.Generator,
    unexplained: Sequence[int] = (),
) -> Array:
    """The best point of each set of attachments, best first; see ``ranked``."""
    best_first = ranked(points, solver, rng, unexplained)
    firsts = best_of_each(unknowns.keys(best_first), -np.arange(len(best_first), dtype=float))
    rest: Array = best_first[firsts]
    return rest
