"""The best motor programs by a score: many at random, and the best of them varied."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.errors import EstimatorError

Score: TypeAlias = Callable[[Array], ArrayLike]
"""Scores of p motor programs, rad, shape (p, joints): p numbers, the higher the better."""

CANDIDATES: Final = 1000
"""Programs that are drawn at first."""

_LIKELY: Final = 100  # best candidates by the rough score, which are scored more precisely
_REFINED: Final = 8  # best programs that are varied
_VARIANTS: Final = 8  # variants of each of these programs
_SPREADS: Final = (math.radians(6.0), math.radians(3.0))
_FINALISTS: Final = 20


def best_programs(
    score: Score,
    program_range: ArrayLike,
    rng: np.random.Generator,
    *,
    candidates: ArrayLike | None = None,
    moved: Flags | None = None,
    rough: Score | None = None,
    sure: Score | None = None,
    spreads: Sequence[float] = _SPREADS,
) -> tuple[Array, Array]:
    """Motor programs that score well.

    The best of many random ones are varied, again and again. A hundred candidates are scored by
    ``score``, those that ``rough`` finds best; and only finalists by ``sure``.

    Args:
        score: Score that is maximised.
        program_range: Lowest and highest target of each joint, rad, shape (joints, 2):
            ``FittedPosterior.program_range``.
        rng: Draws the programs.
        candidates: Programs to begin with, rad, shape (p, joints); by default 1,000 drawn from the
            range.
        moved: Which joints of each candidate are varied, shape (p, joints); the others keep their
            targets. By default all are varied.
        rough: A cheaper score, for the candidates; by default ``score``.
        sure: A more expensive score, which ranks the finalists; by default ``score`` ranks them.
        spreads: Standard deviations of targets, rad, one for each time that programs are varied; by
            default two, the second smaller.

    Returns:
        The finalists, rad, best first, shape (20, joints), or fewer where there are fewer
        candidates; and their scores, shape (20,).

    Raises:
        EstimatorError: The range, the candidates or what is moved of them have a wrong shape, or a
            score is not one number for each program; NaN does not count as one.
    """
    ends = np.asarray(program_range, dtype=float)
    if ends.ndim != 2 or ends.shape[1] != 2:
        raise EstimatorError(f"a range of programs has the shape (joints, 2), not {ends.shape}")
    low, high = ends.T
    if candidates is None:
        candidates = rng.uniform(low, high, (CANDIDATES, len(low)))
    programs = np.asarray(candidates, dtype=float)
    if programs.ndim != 2 or programs.shape[1:] != low.shape or not len(programs):
        raise EstimatorError(
            f"candidates have the shape ({CANDIDATES}, {len(low)}), or another number of programs, "
            f"not {programs.shape}"
        )
    varied = np.ones(programs.shape, dtype=bool) if moved is None else np.asarray(moved, dtype=bool)
    if varied.shape != programs.shape:
        raise EstimatorError(
            f"what is moved has the shape of the candidates, {programs.shape}, not {varied.shape}"
        )
    rows = _best(_scored(rough or score, programs), _LIKELY)
    programs, varied = programs[rows], varied[rows]
    scores = _scored(score, programs)
    for spread in spreads:
        rows = np.repeat(_best(scores, _REFINED), _VARIANTS)
        best, free = programs[rows], varied[rows]
        variants = np.clip(best + rng.normal(0, spread, best.shape), low, high)
        variants = np.where(free, variants, best)
        programs, varied = np.concatenate([programs, variants]), np.concatenate([varied, free])
        scores = np.concatenate([scores, _scored(score, variants)])
    rows = _best(scores, _FINALISTS)
    programs, scores = programs[rows], scores[rows]
    if sure is not None:
        scores = _scored(sure, programs)
        rows = _best(scores, _FINALISTS)
        programs, scores = programs[rows], scores[rows]
    return programs, scores


def _best(scores: Array, count: int) -> NDArray[np.intp]:
    order: NDArray[np.intp] = np.argsort(-scores, kind="stable")[:count]
    return order


def _scored(score: Score, programs: Array) -> Array:
    scores, shape = np.asarray(score(programs), dtype=float), (len(programs),)
    if scores.shape != shape:
        raise EstimatorError(f"scores of programs have the shape {shape}, not {scores.shape}")
    if missing := np.count_nonzero(np.isnan(scores)):
        raise EstimatorError(f"a score is a number, but {missing} of {len(scores)} scores are NaN")
    return scores
