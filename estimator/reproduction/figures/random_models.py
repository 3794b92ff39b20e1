"""Models drawn at random: the baseline of Figure 3."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.limbs import leg_lengths
from estimator.body.morphology import Array
from estimator.problem.genome import Genome
from estimator.search.randomness import Stream, generator

MODELS: Final = 5000
_SEED: Final = 0


@dataclass(frozen=True, kw_only=True)
class Quality:
    """How good leg lengths are, by the measures of Figure 3; one value per model.

    Attributes:
        mean_error: Mean of |leg - true leg|, m (Figure 3a).
        spread: Longest minus shortest leg, m (Figure 3b, by its caption).
        variance: Variance over the legs, m² (Figure 3b, by the text).
    """

    mean_error: Array
    spread: Array
    variance: Array


def quality(lengths: Array, true_lengths: Array) -> Quality:
    """The measures of some models.

    Args:
        lengths: m, shape (models, legs).
        true_lengths: m, shape (legs,).
    """
    return Quality(
        mean_error=np.mean(np.abs(lengths - true_lengths), axis=1),
        spread=np.ptp(lengths, axis=1),
        variance=np.var(lengths, axis=1),
    )


def random_models(genome: Genome, true_lengths: Array) -> Quality:
    """The measures of models whose genes were drawn at random, as the first population's are."""
    genes = generator(_SEED, Stream.RANDOM_MODELS).random((MODELS, genome.size))
    return quality(leg_lengths(genome.decode_all(genes)), true_lengths)
