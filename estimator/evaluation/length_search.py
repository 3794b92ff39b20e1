"""Whether a body with given attachments feels like the true one at some lengths of its parts.

Where a locked leg is divided, and how long a part is that ends inside another, cannot be felt, so
attachments other than the true ones may need other lengths to feel the same. The lengths are found
by damped Gauss-Newton steps on tilt and clearance, weighted so that poses in which the bodies rest
on different feet do not pull (Cauchy's weights, their width from 20 tolerances down to a third).
A body that then differs in a few poses only may have a length that counts in those alone: each
length in turn is tried over its whole range, and the steps start anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from estimator.body.arrays import Bodies
from estimator.body.morphology import Array, Morphology
from estimator.physics.equivalence import Reference

_PROGRAMS: Final = 80  # compared in one round; the next round takes others
_ROUNDS: Final = 4
_WIDE_WIDTHS: Final = (20.0, 10.0, 5.0, 3.0)
_NARROW_WIDTHS: Final = (2.0, 1.0, 0.5, 0.3)
_DAMPING: Final = (1e-4, 1e-2, 1.0, 100.0)  # of a step, relative to the curvature; all are tried
_CURVATURE: Final = 100.0  # of a length that is not felt, in squared tolerances per m²
_DIFFERENCE: Final = 5e-4  # m
_LONGEST_STEP: Final = 0.04  # m
_GRID: Final = 24  # lengths tried of one part
_HOPELESS_SHARE: Final = 0.3
_HOPEFUL_SHARE: Final = 0.9
"""Share of programs in which a body must agree for its lengths to be tried one by one."""


class LengthSearch:
    """Compares attachments with those of a reference, whatever the lengths.

    Args:
        reference: Body that others are compared with.
        ranges: Shortest and longest length of each part, m, shape (parts, 2).
    """

    def __init__(self, reference: Reference, ranges: Array):
        self._reference = reference
        self._ranges = ranges

    def is_like(self, starts: Sequence[Morphology]) -> bool:
        """Whether a body, at some lengths of its parts, cannot be told from the reference.

        Args:
            starts: The body at lengths from which to search; these may lie outside the ranges.
        """
        if any(self._reference.is_like(body) for body in starts):
            return True
        lengths = np.array([[part.length for part in body.parts] for body in starts])
        trial = _Trial(
            self._reference,
            Bodies.of(starts[:1]),
            lower=np.minimum(self._ranges[:, 0], lengths.min(axis=0)),
            upper=np.maximum(self._ranges[:, 1], lengths.max(axis=0)),
        )
        nearest = trial.descend(trial.best(lengths, width=_WIDE_WIDTHS[0]), _WIDE_WIDTHS)
        if trial.agreement(nearest) < _HOPELESS_SHARE:
            return False
        for number in range(_ROUNDS):
            trial.take(number)
            nearest = trial.descend(nearest, _NARROW_WIDTHS)
            if self._reference.is_like(starts[0].with_lengths(nearest.tolist())):
                return True
            if trial.agreement(nearest) < _HOPEFUL_SHARE:
                return False
            nearest = trial.scan(nearest)
        return False


class _Trial:
    """One body whose lengths are varied."""

    def __init__(self, reference: Reference, body: Bodies, *, lower: Array, upper: Array):
        self._reference = reference
        self._body = body
        self._lower = lower
        self._upper = upper
        self._free = np.flatnonzero(upper > lower)
        self._rows = reference.informative[:_PROGRAMS]

    def take(self, number: int) -> None:
        """Takes the programs of round ``number`` for the comparisons that follow."""
        self._rows = np.roll(self._reference.informative, -number * _PROGRAMS)[:_PROGRAMS]

    def residuals(self, lengths: Array) -> Array:
        """Differences from the reference for lengths of shape (n, parts): (n, programs, values)."""
        bodies = self._body[np.zeros(len(lengths), dtype=np.intp)]
        return self._reference.residuals(replace(bodies, length=lengths), self._rows)

    def best(self, lengths: Array, *, width: float) -> Array:
        """Lengths that fit best, shape (parts,), among some of shape (n, parts)."""
        cost = np.log1p((self.residuals(lengths) / width) ** 2).mean(axis=(1, 2))
        nearest: Array = lengths[int(np.argmin(cost))]
        return nearest

    def agreement(self, lengths: Array) -> float:
        """Share of the programs in which no difference exceeds its tolerance."""
        return float(np.mean(np.all(np.abs(self.residuals(lengths[None])) <= 1, axis=2)))

    def descend(self, lengths: Array, widths: Sequence[float]) -> Array:
        """Lengths after Gauss-Newton steps, one for each width of the weights."""
        for width in widths:
            shifted = np.repeat(lengths[None], 1 + len(self._free), axis=0)
            shifted[np.arange(1, len(shifted)), self._free] += _DIFFERENCE
            residuals = self.residuals(shifted).reshape(len(shifted), -1)
            slopes = (residuals[1:] - residuals[0]) / _DIFFERENCE
            weighted = slopes / (1 + (residuals[0] / width) ** 2)
            curvature, gradient = weighted @ slopes.T, weighted @ residuals[0]
            damping = np.diag(np.diag(curvature) + _CURVATURE)
            steps = np.zeros((1 + len(_DAMPING), len(lengths)))
            for row, factor in enumerate(_DAMPING, 1):
                steps[row, self._free] = np.linalg.solve(curvature + factor * damping, gradient)
            steps = np.clip(steps, -_LONGEST_STEP, _LONGEST_STEP)
            lengths = self.best(np.clip(lengths - steps, self._lower, self._upper), width=width)
        return lengths

    def scan(self, lengths: Array) -> Array:
        """Lengths after trying each over its whole range, one part after another."""
        for part in self._free:
            tried = np.repeat(lengths[None], 1 + _GRID, axis=0)
            tried[1:, part] = np.linspace(self._lower[part], self._upper[part], _GRID)
            lengths = self.best(tried, width=1.0)
        return lengths
