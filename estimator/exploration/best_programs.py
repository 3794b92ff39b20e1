"""The best motor programs by a score: many at random, and the best of them varied."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

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
    rough: Score | None = None,
    sure: Score | None = None,
    spreads: Sequence[float] = _SPREADS,
) -> tuple[Array, Array]:
    """Motor programs that score well.

    The best of many random ones are varied, again and again. A joint whose target is 0 stays
    there. A hundred candidates are scored by ``score``, those that ``rough`` finds best; and only
    finalists by ``sure``.

    Args:
        score: Score that is maximised.
        program_range: Lowest and highest target of each joint, rad, shape (joints, 2):
            ``FittedPosterior.program_range``.
        rng: Draws the programs.
        candidates: Programs to begin with, rad, shape (p, joints); by default 1,000 drawn from the
            range.
        rough: A cheaper score, for the candidates; by default ``score``.
        sure: A more expensive score, which ranks the finalists; by default ``score`` ranks them.
        spreads: Standard deviations of targets, rad, one for each time that programs are varied; by
            default two, the second smaller.

    Returns:
        The finalists, rad, best first, shape (20, joints), or fewer where there are fewer
        candidates; and their scores, shape (20,).

    Raises:
        EstimatorError: The range or the candidates have a wrong shape, or a score is not one number
            for each program; NaN does not count as one.
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
    programs, _ = _best(programs, _scored(rough or score, programs), _LIKELY)
    scores = _scored(score, programs)
    for spread in spreads:
        best = np.repeat(_best(programs, scores, _REFINED)[0], _VARIANTS, axis=0)
        variants = np.clip(best + rng.normal(0, spread, best.shape), low, high)
        variants = np.where(best == 0, 0.0, variants)
        programs = np.concatenate([programs, variants])
        scores = np.concatenate([scores, _scored(score, variants)])
    programs, scores = _best(programs, scores, _FINALISTS)
    if sure is not None:
        programs, scores = _best(programs, _scored(sure, programs), _FINALISTS)
    return programs, scores


def _best(programs: Array, scores: Array, count: int) -> tuple[Array, Array]:
    order = np.argsort(-scores, kind="stable")[:count]
    return programs[order], scores[order]


def _scored(score: Score, programs: Array) -> Array:
    scores, shape = np.asarray(score(programs), dtype=float), (len(programs),)
    if scores.shape != shape:
        raise EstimatorError(f"scores of programs have the shape {shape}, not {scores.shape}")
    if missing := np.count_nonzero(np.isnan(scores)):
        raise EstimatorError(f"a score is a number, but {missing} of {len(scores)} scores are NaN")
    return scores
