"""Bodies that differ from one in a limb, or in two that have changed places.

A leg put on in another way is another in all of its parts at once, and so is the one whose mount
it takes: none of these changes alone makes a body better, so chains that change one row hardly ever
get from one to the other. Here all of them are tried, the likely ones with better lengths. This
finds where the posterior is; it does not leave it invariant.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import partial
from itertools import product
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.chains.rows import exchange_places
from estimator.posterior.discovery.part_trees import exchanged, joined_parts
from estimator.posterior.discovery.ranking import ranked_by_attachments
from estimator.posterior.model.gauss_newton import GaussNewton, best_of_each
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Columns, Predictor

_LENGTHS: Final = 2  # times each choice is tried: with the parts' lengths, and random ones
_KEPT: Final = 16  # of the rows of parts that are joined
_NEWCOMERS: Final = 3  # on a mount that was another's, for each of which
_SETTLED: Final = 2  # rows of that other one are kept
_POLISHED: Final = 32  # of all


class Neighbours:
    """Finds better bodies near others.

    Where it is not known which part sits on which, that is any part put on in another way, alone
    and with any other on it.

    Args:
        predictor: Computes readings.
        data: The observations.
        likelihood: Of ``data``.
        rng: Draws lengths.
    """

    def __init__(
        self,
        predictor: Predictor,
        data: SensorData,
        likelihood: Likelihood,
        rng: np.random.Generator,
    ) -> None:
        self._unknowns = predictor.unknowns
        self._joined = joined_parts(predictor.unknowns)
        self._solver = GaussNewton(predictor, data, likelihood)
        self._rng = rng

    def of(self, leader: Array) -> tuple[Array, Array]:
        """Points near one of shape (size,), with good lengths, and their log-likelihoods.

        At most ``_POLISHED``; no two have the same attachments when they are chosen.
        """
        by_pairs = self._unknowns.parents.any()  # what takes two steps explains nothing after one
        ranking = partial(
            ranked_by_attachments,
            solver=self._solver,
            unknowns=self._unknowns,
            rng=self._rng,
            unexplained=self._solver.unexplained(leader) if by_pairs else (),
        )
        near = [self._unknowns.permitted(exchanged(leader, self._unknowns))]
        for joined in self._joined:
            carrying = leader[None].copy()
            for column, value in joined.carried:
                carrying[:, column] = value
            points = ranking(self._rows(carrying, joined.columns, joined.kept))
            near.append(points[:_KEPT])
            for newcomers, displaced in self._newcomers(points, leader, joined.columns):
                near += [
                    ranking(self._rows(newcomers, other.columns, (displaced,)))[:_SETTLED]
                    for other in self._joined
                    if displaced in other.columns and displaced not in other.kept
                ]
        points = np.concatenate(near)
        fits = self._solver.rough_fits(points, np.arange(self._solver.interactions)).sum(axis=1)
        best = best_of_each(self._unknowns.keys(points), fits)
        return self._solver.polished(points[best], _POLISHED)

    def _rows(self, leaders: Array, columns: Columns, kept: Collection[int]) -> Array:
        """Leaders with all that some columns choose, but for those kept, each at several lengths.

        A part that takes another's place leaves its own to it.
        """
        unknowns = self._unknowns
        counts = unknowns.counts[columns]
        lengths = columns[counts == 0]
        choices = np.array([one for one in columns[counts > 0] if one not in kept], dtype=np.intp)
        cells = np.array(list(product(*map(range, unknowns.counts[choices])))) + 0.5
        before = np.repeat(leaders, len(cells) * _LENGTHS, axis=0)
        points = before.copy()
        several = np.repeat(cells / unknowns.counts[choices], _LENGTHS, axis=0)
        points[:, choices] = np.tile(several, (len(leaders), 1))
        drawn = np.arange(len(points)) % _LENGTHS > 0
        points[np.ix_(drawn, lengths)] = self._rng.random((np.count_nonzero(drawn), lengths.size))
        exchange_places(points, before, unknowns)
        return unknowns.permitted(points)

    def _newcomers(
        self, points: Array, leader: Array, columns: Columns
    ) -> Iterator[tuple[Array, int]]:
        """For each part that lost its mount, the column that says so and the first such points."""
        if self._unknowns.parents.any():
            return
        chosen, before = (self._unknowns.decided(values) for values in (points, leader[None]))
        for places in self._unknowns.places:
            for column in np.setdiff1d(places[:, 0], columns).tolist():
                lost = np.flatnonzero(chosen[:, column] != before[0, column])[:_NEWCOMERS]
                if lost.size:
                    yield points[lost], column
