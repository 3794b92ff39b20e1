"""Evidence and particles of hypotheses: sets of attachments, and what is open beside their lengths.

Here the points are found that the integration starts from: peaks of the posterior with narrow
components of the table of parameters alone, and the best points with each wide one. The latter are
searched from any lengths, since a deviation that is left out biases the lengths that are fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.parameters.table import MEDIAN_CARE
from estimator.posterior.model.gauss_newton import Free, GaussNewton, best_of_each
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Columns, Cost, Predictor
from estimator.posterior.sampling.tempering import Particles, Target, equilibrated, tempered

_ANYWHERE: Final = 100  # points with random lengths, the best of which a fit starts from
_DRAWN: Final = 1000  # points drawn from the prior of lengths and narrow components
_STARTS: Final = 4  # best of these points, from which fits start
_START_DEVIATIONS: Final = (1.5, 1.5, 0.6)  # of starting points in turn, in standard deviations
_PEAKS: Final = 3  # peaks of a hypothesis, at most, around which particles start
_LOWEST_PEAK: Final = 10.0  # nats below the best peak beyond which a peak does not count


class Hypothesis(NamedTuple):
    """A set of attachments, and what is open beside its lengths.

    Attributes:
        point: Point with these attachments, from which fits start, shape (size,).
        wide: Row of the table whose wide component is open; −1: none is.
        as_stated: Whether there are no deviations, and only lengths are open.
        log_prior: Logarithm of the hypothesis's prior probability, given the set.
        log_chance: Logarithm of the chance with which the set was drawn, among many.
    """

    point: Array
    wide: int = -1
    as_stated: bool = False
    log_prior: float = 0.0
    log_chance: float = 0.0


class Integrals:
    """Evidence and particles of hypotheses; travels to worker processes.

    Args:
        predictor: Computes readings.
        likelihood: Likelihood of the observations.
    """

    def __init__(self, predictor: Predictor, likelihood: Likelihood) -> None:
        self._predictor, self._likelihood = predictor, likelihood
        self._solver = GaussNewton(predictor, likelihood)
        self._lengths = predictor.unknowns.continuous
        table = predictor.unknowns.table
        self._offset = predictor.unknowns.genes_size
        self._narrow = {
            row: parameter.narrow * (MEDIAN_CARE if parameter.by_care else 1.0)
            for row, parameter in enumerate(table)
            if parameter.narrow
        }
        self._hinges: dict[int | None, int] = {
            gene.part: column
            for column, gene in enumerate(predictor.unknowns.genes)
            if gene.trait == "hinge" and gene.is_choice
        }
        self._by_care = self._offset + np.flatnonzero([parameter.by_care for parameter in table])

    def with_cost(
        self, task: tuple[Sequence[Hypothesis], int, bool, int]
    ) -> tuple[list[tuple[Hypothesis, Particles]], Cost]:
        """Hypotheses with their best points, particles of each, and the cost of computing them.

        Args:
            task: Hypotheses with equally many columns open, the number of particles of each,
                whether these start around several peaks, and a seed.
        """
        hypotheses, particles, several_peaks, seed = task
        before, rng = self._predictor.cost, np.random.default_rng(seed)
        points = np.array([one.point for one in hypotheses])
        free = Free.with_parameters(
            self._predictor.unknowns, [self.opened(one) for one in hypotheses]
        )
        peaks = self._peaks(points, free, rng if several_peaks else None)
        target = self._target(hypotheses, peaks, free, rng)
        results = tempered(target, particles)
        better = (one._replace(point=tops[0]) for one, tops in zip(hypotheses, peaks, strict=True))
        return list(zip(better, results, strict=True)), self._predictor.cost.since(before)

    def equilibrated_with_cost(self, task: tuple[Hypothesis, Array, int]) -> tuple[Array, Cost]:
        """Equilibrated points of a hypothesis, and the cost of computing them.

        Args:
            task: The hypothesis, lengths and θ of some particles (``Particles.own``), and a seed.
        """
        hypothesis, own, seed = task
        before, rng = self._predictor.cost, np.random.default_rng(seed)
        free = Free.with_parameters(self._predictor.unknowns, [self.opened(hypothesis)])
        values = equilibrated(
            self._target([hypothesis], hypothesis.point[None, None], free, rng), own
        )
        return values, self._predictor.cost.since(before)

    def _target(
        self, hypotheses: Sequence[Hypothesis], peaks: Array, free: Free, rng: np.random.Generator
    ) -> Target:
        """The target of hypotheses with peaks of shape (n, p, size)."""
        count, peak_count, size = peaks.shape
        owners = np.repeat(np.arange(count), peak_count)
        slopes = self._solver.slopes(peaks.reshape(-1, size), free=free[owners])
        return Target(
            peaks=peaks,
            free=free,
            precision=slopes.precision.reshape(count, peak_count, *slopes.precision.shape[1:]),
            by_care=self._by_care_alone(free, hypotheses),
            predictor=self._predictor,
            likelihood=self._likelihood,
            rng=rng,
        )

    def opened(self, one: Hypothesis) -> dict[int, float]:
        """Rows of the table that are open beside the lengths, with their standard deviations."""
        table = self._predictor.unknowns.table
        rows = {} if one.as_stated else dict(self._narrow)
        if one.wide >= 0 and not table[one.wide].switch:
            rows[one.wide] = table[one.wide].wide
        return rows

    def _by_care_alone(self, free: Free, hypotheses: Sequence[Hypothesis]) -> Flags:
        """Which columns have spreads that care decides, but for that of a wide component."""
        wide = np.array([[self._offset + one.wide if one.wide >= 0 else -1] for one in hypotheses])
        flags: Flags = np.isin(free.columns, self._by_care) & (free.columns != wide)
        return flags

    def _peaks(self, points: Array, free: Free, rng: np.random.Generator | None) -> Array:
        """Peaks of the posterior of each hypothesis, shape (n, peaks, size), the best first.

        Args:
            points: One point of each hypothesis, shape (n, size), from which fits start.
            free: Columns that are open.
            rng: Draws further starts; ``None``: fits start from ``points`` alone.
        """
        starts = [points, *(self._drawn(points, free, rng) if rng else [])]
        index = np.arange(len(points))
        polished, fits = self._solver.polished(
            np.vstack(starts), free=free[np.tile(index, len(starts))]
        )
        by_start = polished.reshape(len(starts), len(points), -1)
        fits = fits.reshape(len(starts), -1)
        order = np.argsort(-fits, axis=0, kind="stable")[:_PEAKS]
        order = np.where(fits[order, index] < fits[order[0], index] - _LOWEST_PEAK, order[0], order)
        return np.swapaxes(by_start[order, index], 0, 1)

    def _drawn(self, points: Array, free: Free, rng: np.random.Generator) -> list[Array]:
        """The best of many points drawn from the prior, as arrays of shape (n, size)."""
        count, owners = len(points), np.repeat(np.arange(len(points)), _DRAWN)
        shape = (len(owners), free.columns.shape[1])
        fitted = np.where(free.normal, rng.standard_normal(shape), rng.random(shape))
        drawn = free[owners].within(points[owners], fitted)
        fits = self._solver.rough_fits(drawn).sum(axis=1).reshape(count, -1)
        first = np.argsort(-fits, axis=1, kind="stable")[:, :_STARTS]
        best = drawn.reshape(count, _DRAWN, -1)[np.arange(count)[:, None], first]
        return list(np.swapaxes(best, 0, 1))

    def fitted_with_cost(
        self, task: tuple[Sequence[int], Array, Mapping[int, Array], int]
    ) -> tuple[list[tuple[float, int, Array]], Cost]:
        """The best points with each of some wide components, and the cost of finding them.

        Lengths alone are fitted with a component. Where a part no longer turns on its hinge under
        it, each hinge is tried: as stated, the readings speak for one about which the part need not
        turn.

        Args:
            task: Rows of the table, all of which have amounts or none; −1: no wide component.
                Points of one set of attachments from which fits start, shape (n, size), the first
                as stated; points with wide components, by row, from which fits of these rows start,
                too; and a seed, which draws other lengths of the last as further starts.

        Returns:
            Laplace's approximation of the evidence, the row, and the point, for each row and set of
            attachments.
        """
        rows, starts, known, seed = task
        before, rng = self._predictor.cost, np.random.default_rng(seed)
        table = self._predictor.unknowns.table
        sizes = np.array([table[row].wide or 1.0 for row in rows])  # that of −1 is not used
        have_amounts = not (rows[0] < 0 or table[rows[0]].switch)
        anywhere = np.repeat(starts[-1:], _ANYWHERE, axis=0)
        anywhere[:, self._lengths] = rng.random((_ANYWHERE, self._lengths.size))
        offs = rng.standard_normal(_ANYWHERE) if have_amounts else np.ones(_ANYWHERE)
        points, which = self._with_wide(anywhere, rows, offs[:, None] * sizes)
        fits = self._solver.rough_fits(points).sum(axis=1).reshape(_ANYWHERE, -1)
        first = np.arange(len(rows)) + len(rows) * np.argmax(fits, axis=0)
        pieces = [(points[first], which[first])]
        amounts = np.resize(_START_DEVIATIONS if have_amounts else 1.0, (len(starts), 1)) * sizes
        for sign in (-1, 1) if have_amounts else (1,):
            pieces.append(self._with_wide(starts, rows, sign * amounts))
        pieces += [(known[row][None], np.array([row])) for row in rows if row in known]
        stopping = [row for row in rows if row >= 0 and table[row].stops is not None]
        for row in stopping:
            standing = self._standing_still(starts[0], row, rng)
            pieces.append((standing, np.full(len(standing), row)))
        points, which = (np.concatenate(arrays) for arrays in zip(*pieces, strict=True))
        points, fits = self._polished_with(points, which)
        for row in stopping:
            of_row = np.flatnonzero(which == row)
            hinged = self._on_each_hinge(points[of_row[np.argmax(fits[of_row])]], row)
            more_points, more_fits = self._polished_with(hinged, np.full(len(hinged), row))
            points, fits = np.concatenate([points, more_points]), np.concatenate([fits, more_fits])
            which = np.concatenate([which, np.full(len(hinged), row)])
        keys = zip(which.tolist(), self._predictor.unknowns.keys(points), strict=True)
        chosen = best_of_each([(row, *key) for row, key in keys], fits)
        points, which = points[chosen], which[chosen]
        guesses = fits[chosen] + self._solver.half_volumes(points, self._with_amounts(which))
        fitted = list(zip(guesses.tolist(), which.tolist(), points, strict=True))
        return fitted, self._predictor.cost.since(before)

    def _polished_with(self, points: Array, which: Columns) -> tuple[Array, Array]:
        """Points that fit better, each with its wide component, and their fits with all priors.

        Where no reading tells of an amount the prior leads it to 0, which is as stated: no fit.
        """
        polished, fits = self._solver.polished(points, free=self._with_amounts(which))
        amounts = polished[np.arange(len(which)), self._offset + which]
        fits = np.where((which >= 0) & (amounts == 0), -np.inf, fits)
        return polished, fits + self._predictor.unknowns.log_narrow(polished, which)

    def _with_amounts(self, which: Columns) -> Free:
        """Lengths and the amounts of wide components, all of which have an amount or none has."""
        unknowns = self._predictor.unknowns
        have_amounts = which[0] >= 0 and not unknowns.table[which[0]].switch
        wide = [{row: unknowns.table[row].wide} if have_amounts else {} for row in which.tolist()]
        return Free.with_parameters(unknowns, wide)

    def _standing_still(self, known: Array, row: int, rng: np.random.Generator) -> Array:
        """A known point with each hinge of a part that stands still, by a row of the table.

        Each with the best of many angles, and lengths of that part.
        """
        unknowns, angle = self._predictor.unknowns, self._offset + row
        part = unknowns.table[row].stops
        lengths = [column for column in self._lengths if unknowns.genes[column].part == part]
        points = known.copy()
        points[angle] = unknowns.table[row].wide
        points = self._on_each_hinge(points, row).repeat(_ANYWHERE // 2, axis=0)
        points[:, lengths] = rng.random((len(points), len(lengths)))
        points[:, angle] *= np.abs(rng.standard_normal(len(points)))
        fits = self._solver.rough_fits(points).sum(axis=1).reshape(-1, _ANYWHERE)
        best: Array = points[np.argmax(fits, axis=1) + _ANYWHERE * np.arange(len(fits))]
        return best

    def _on_each_hinge(self, point: Array, row: int) -> Array:
        """A point with each hinge of the part that a row stops, at its angle to either side."""
        unknowns = self._predictor.unknowns
        hinge = self._hinges.get(unknowns.table[row].stops)
        count = unknowns.genes[hinge].choices if hinge is not None else 1
        points = point[None].repeat(2 * count, axis=0)
        points[1::2, self._offset + row] *= -1
        if hinge is not None:
            points[:, hinge] = np.repeat((np.arange(count) + 0.5) / count, 2)
        return points

    def _with_wide(
        self, points: Array, rows: Sequence[int], amounts: Array
    ) -> tuple[Array, Columns]:
        """Each of n points with each of these wide components alone, and which component it has.

        Args:
            points: Points, shape (n, size).
            rows: Rows of the table; −1: no wide component.
            amounts: Amount of each component at each point, shape (n, rows).

        Returns:
            Points, shape (n · rows, size), and the row of each, shape (n · rows,).
        """
        which = np.tile(np.array(rows, dtype=np.intp), len(points))
        repeated = np.repeat(points, len(rows), axis=0)
        chosen = np.flatnonzero(which >= 0)
        repeated[chosen, self._offset + which[chosen]] = amounts.ravel()[chosen]
        return repeated, which
