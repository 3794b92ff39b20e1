"""Bodies that differ from a given one in one limb, or in two limbs that have changed places.

A leg that is attached in another way differs in all of its parts at once, and so does the leg whose
mount it takes. No single change improves a body, so chains that change one attachment at a time
hardly ever get there. Here all combinations are tried, and lengths of the most likely optimised.

Independent searches find different legs of the true body: recombination gives one body subtrees of
another. A subtree is a part with all that it carries, and is exchanged as a whole, as in genetic
programming (Koza 1992): a part means little without what it carries.

All this finds where the posterior is; it does not leave it invariant.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Final

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import BASE, Array
from estimator.posterior.discovery.moves import exchange_places
from estimator.posterior.model.gauss_newton import GaussNewton, best_of_each
from estimator.posterior.model.unknowns import Columns, Unknowns

_LENGTHS_TRIED: Final = 2  # with each choice: the parts' lengths, and random ones
_KEPT_ATTACHMENTS: Final = 16  # best attachments of joined parts, which are kept
_NEWCOMERS: Final = 3  # bodies for each mount that was taken from another part
_DISPLACED: Final = 2  # attachments of that other part that are kept for each of these bodies
_POLISHED: Final = 32  # neighbours, and recombined bodies, whose lengths are optimised


class Neighbours:
    """Tries bodies that differ from a given one in one or two limbs.

    Where it is not known which part sits on which, a limb is any part, alone or with any other part
    on it.

    Args:
        unknowns: The cube.
        solver: Compares bodies, and optimises their lengths.
        rng: Draws lengths.
    """

    def __init__(self, unknowns: Unknowns, solver: GaussNewton, rng: np.random.Generator) -> None:
        self._unknowns = unknowns
        self._joined = joined_parts(unknowns)
        self._solver = solver
        self._rng = rng

    def of(self, leader: Array) -> tuple[Array, Array]:
        """Points near one of shape (size,), with optimised lengths, and their log-likelihoods.

        At most ``_POLISHED``; no two have the same attachments when they are chosen.
        """
        ranking = partial(ranked, solver=self._solver, unknowns=self._unknowns, rng=self._rng)
        candidates = []
        for joined in self._joined:
            carrying = leader[None].copy()
            for column, value in joined.carried:
                carrying[:, column] = value
            points = ranking(self._rows(carrying, joined.columns, joined.kept))
            candidates.append(points[:_KEPT_ATTACHMENTS])
            for newcomers, displaced in self._newcomers(points, leader, joined.columns):
                candidates += [
                    ranking(self._rows(newcomers, other.columns, (displaced,)))[:_DISPLACED]
                    for other in self._joined
                    if displaced in other.columns and displaced not in other.kept
                ]
        points = np.concatenate(candidates)
        fits = self._solver.rough_fits(points).sum(axis=1)
        best = best_of_each(self._unknowns.keys(points), fits)
        return self._solver.polished(points[best], _POLISHED)

    def _rows(self, leaders: Array, columns: Columns, kept: Collection[int]) -> Array:
        """Leaders with all choices of some columns, but for those kept, each at several lengths.

        Where a part takes another's place, the other part gets the place of the first.
        """
        unknowns = self._unknowns
        counts = unknowns.counts[columns]
        lengths = columns[counts == 0]
        choices = np.array([one for one in columns[counts > 0] if one not in kept], dtype=np.intp)
        cells = np.array(list(product(*map(range, unknowns.counts[choices])))) + 0.5
        before = np.repeat(leaders, len(cells) * _LENGTHS_TRIED, axis=0)
        points = before.copy()
        chosen = np.repeat(cells / unknowns.counts[choices], _LENGTHS_TRIED, axis=0)
        points[:, choices] = np.tile(chosen, (len(leaders), 1))
        drawn = np.flatnonzero(np.arange(len(points)) % _LENGTHS_TRIED)[:, None]
        points[drawn, lengths] = self._rng.random((len(drawn), lengths.size))
        exchange_places(points, before, unknowns)
        return unknowns.permitted(points)

    def _newcomers(
        self, points: Array, leader: Array, columns: Columns
    ) -> Iterator[tuple[Array, int]]:
        """For each part that lost its mount, the first such points and the column of that mount."""
        if self._unknowns.parents.any():
            return
        chosen, before = (self._unknowns.decided(values) for values in (points, leader[None]))
        for places in self._unknowns.places:
            for column in np.setdiff1d(places[:, 0], columns).tolist():
                lost = np.flatnonzero(chosen[:, column] != before[0, column])[:_NEWCOMERS]
                if lost.size:
                    yield points[lost], column


_LONGEST: Final = 3  # parts in a chain that are tried together, at most


@dataclass(frozen=True, kw_only=True)
class Joined:
    """A chain of one, two or three parts with open attachments, each of which carries the next.

    Attributes:
        columns: Columns of all its parts.
        kept: Columns that stay as they are: of three parts the mount of the first, and chosen
            parents.
        carried: Columns of chosen parents, each with the value that puts a part on the one before.
    """

    columns: Columns
    kept: tuple[int, ...] = ()
    carried: tuple[tuple[int, float], ...] = ()


def joined_parts(unknowns: Unknowns) -> tuple[Joined, ...]:
    """Chains of parts whose attachments are best changed together.

    Where parents are known, the parts of a limb; where they are not, but many attachments are open,
    each part by itself and with each that may sit on it. None otherwise.
    """
    if not unknowns.parents.any():
        return _joined(unknowns)
    return _possibly_joined(unknowns) if unknowns.many else ()


def subtrees(point: Array, unknowns: Unknowns) -> list[Flags]:
    """Which columns of a point belong to each part or to what it carries, shape (genes,) each."""
    parents = unknowns.bodies(point[None]).parent[0].tolist()
    carried = [{part} for part in range(len(parents))]
    for part in reversed(range(len(parents))):
        if parents[part] != BASE:
            carried[parents[part]] |= carried[part]
    return [np.array([gene.part in parts for gene in unknowns.genes]) for parts in carried]


def _possibly_joined(unknowns: Unknowns) -> tuple[Joined, ...]:
    genes, of_parts = unknowns.genes, unknowns.parts
    chosen = sorted({gene.part for gene in genes if gene.is_choice})
    joined = [Joined(columns=of_parts[part]) for part in chosen]
    for part in chosen:
        for column in of_parts[part].tolist():
            gene = genes[column]
            if gene.trait == "parent":
                joined += [
                    Joined(
                        columns=np.concatenate([of_parts[carrier], of_parts[part]]),
                        kept=(column,),
                        # the middle of the values that stand for it; the main body's come first
                        carried=((column, (carrier + 1.5) / gene.choices),),
                    )
                    for carrier in chosen
                    if carrier < part
                ]
            elif gene.trait == "mount" and gene.parent in chosen:
                columns = np.concatenate([of_parts[gene.parent], of_parts[part]])
                joined.append(Joined(columns=columns))
    return tuple(joined)


def _joined(unknowns: Unknowns) -> tuple[Joined, ...]:
    genes, of_parts = unknowns.genes, unknowns.parts
    chosen = {gene.part: gene.parent for gene in genes if gene.is_choice}
    carriers = {
        part: parent for part, parent in chosen.items() if parent is not None and parent in chosen
    }
    joined = []
    for part in chosen:
        chain = [part]
        while len(chain) < _LONGEST and chain[0] in carriers:
            chain.insert(0, carriers[chain[0]])
        if chain == [part] and part in carriers.values():
            continue  # tried with the parts that it carries
        columns = np.concatenate([of_parts[link] for link in chain])
        mounts = [at for at in of_parts[chain[0]].tolist() if genes[at].trait == "mount"]
        joined.append(Joined(columns=columns, kept=tuple(mounts) if len(chain) == _LONGEST else ()))
    return tuple(joined)


_TRIED_FIRST: Final = 2  # interactions by which points are compared first
_GO_ON: Final = 0.25  # share of the points that are compared by the next interactions
_FEWEST_POINTS: Final = 200  # points that go on, at least
_SAMPLED: Final = 0.05  # share of the points by which the order of interactions is decided


def ranked(
    points: Array, solver: GaussNewton, unknowns: Unknowns, rng: np.random.Generator
) -> Array:
    """Those points that fit best under wide noise, one of each set of attachments, best first.

    Points are compared first by interactions in which their fits differ by about the median, and
    only the best of them by the others. Where fits differ most, bodies fall to one side or the
    other whatever their lengths, and right attachments do not stand out.

    Args:
        points: Points of the cube, shape (n, size).
        solver: Compares the points.
        unknowns: The cube.
        rng: Draws the points by which the order of interactions is decided.
    """
    order, tried = np.arange(len(solver.likelihood)), len(solver.likelihood)
    if len(points) > _FEWEST_POINTS and tried > _TRIED_FIRST:
        sample = rng.choice(len(points), round(_SAMPLED * len(points)), replace=False)
        spread = solver.rough_fits(points[sample]).std(axis=0)
        order, tried = np.argsort(np.abs(spread - np.median(spread)), kind="stable"), _TRIED_FIRST
    fits = solver.rough_fits(points, order[:tried]).sum(axis=1)
    while True:
        best = np.argsort(-fits, kind="stable")[: max(_FEWEST_POINTS, round(_GO_ON * len(points)))]
        points, fits = points[best], fits[best]
        if tried < order.size:
            fits = fits + solver.rough_fits(points, order[tried : 2 * tried]).sum(axis=1)
            tried *= 2
        if tried >= order.size:
            return points[best_of_each(unknowns.keys(points), fits)]


def with_subtrees_of_others(
    body: Array, others: Array, unknowns: Unknowns, solver: GaussNewton
) -> tuple[Array, Array]:
    """Best bodies that differ from a given one in a subtree of another, and their log-likelihoods.

    Args:
        body: The given body, shape (size,).
        others: Bodies that subtrees are taken from, shape (n, size).
        unknowns: The cube.
        solver: Compares bodies, and optimises their lengths.
    """
    points = [
        np.where(subtree, other, body) for other in others for subtree in subtrees(other, unknowns)
    ]
    recombined = unknowns.permitted(np.array(points))
    recombined = recombined[best_of_each(unknowns.keys(recombined), np.zeros(len(recombined)))]
    fits = solver.rough_fits(recombined).sum(axis=1)
    return solver.polished(recombined[np.argsort(-fits, kind="stable")[:_POLISHED]])
