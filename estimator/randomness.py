"""All randomness of a run comes from its seed, in streams that do not disturb each other.

So motor programs do not depend on what the search drew, and a resumed run draws what an
uninterrupted one would have drawn.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """What a stream of random numbers is for."""

    SEARCH = 0
    PROGRAMS = 1
    VALIDATION = 2
    RANDOM_MODELS = 3
    EQUIVALENCE = 4


def generator(seed: int, stream: Stream, number: int = 0) -> np.random.Generator:
    """Generator of a stream; ``number`` tells what is drawn separately, such as interactions."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(stream, number)))


def seeds(seed: int, stream: Stream, count: int) -> list[np.random.SeedSequence]:
    """Seeds for generators that several draw from at the same time."""
    return np.random.SeedSequence(seed, spawn_key=(stream,)).spawn(count)
