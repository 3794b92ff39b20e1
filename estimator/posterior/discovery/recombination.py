"""Bodies with subtrees of others: searches that began apart find different legs of the true body.

A subtree is a part with all that it carries. It is taken over as a whole, as in genetic programming
(Koza 1992): a part means little without what it carries. This finds where the posterior is; it does
not leave it invariant.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.discovery.part_trees import subtrees
from estimator.posterior.model.gauss_newton import GaussNewton, best_of_each
from estimator.posterior.model.unknowns import Unknowns

_POLISHED: Final = 32


def with_subtrees_of_others(
    body: Array, others: Array, unknowns: Unknowns, solver: GaussNewton
) -> tuple[Array, Array]:
    """The best bodies that differ from one in a subtree of another.

    Args:
        body: Shape (size,).
        others: Shape (n, size).
        unknowns: The cube.
        solver: Compares and polishes them.

    Returns:
        Points with good solver, and their log-likelihoods.
    """
    points = []
    for other in others:
        for subtree in subtrees(other, unknowns):
            point = body.copy()
            point[subtree] = other[subtree]
            points.append(point)
    several = unknowns.permitted(np.array(points))
    several = several[best_of_each(unknowns.keys(several), np.zeros(len(several)))]
    fits = solver.rough_fits(several, np.arange(solver.interactions)).sum(axis=1)
    return solver.polished(several[np.argsort(-fits, kind="stable")[:_POLISHED]])
