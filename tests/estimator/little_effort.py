"""The method posterior with little effort: each of its steps, in a fraction of the time.

``python -m tests.estimator.little_effort`` is ``estimator`` with it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import pytest

from estimator.__main__ import main
from estimator.exploration import best_programs, information
from estimator.identification import posterior_method
from estimator.posterior.checks import simulator
from estimator.posterior.discovery import discovery, moves
from estimator.posterior.sampling import integrals, tempering, weighing
from estimator.posterior.sampling.sampler import Effort

_LITTLE: Final = Effort(levels=4, chains_per_level=8, steps=10, rounds=1, particles=60, samples=16)

_WEIGHING: Final = (
    (integrals, "_ANYWHERE", 100),
    (integrals, "_DRAWN", 300),
    (tempering, "_MOVES", 2),
    (tempering, "_EQUILIBRATING", 1),
)
_USUALLY: Final = [(module, name, getattr(module, name)) for module, name, _ in _WEIGHING]


@contextmanager
def little_search() -> Iterator[None]:
    """Samplers within it, but not in other processes, do less of everything."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(discovery, "_POLISHED", 20)
        patch.setattr(moves, "_RANDOM", 300)
        patch.setattr(discovery, "_PROMISING", 10)
        patch.setattr(discovery, "_STARTS", 6)
        patch.setattr(weighing, "_MOST", 24)
        yield


@contextmanager
def little_effort() -> Iterator[None]:
    """Runs that begin or go on within it take less time, and find out less."""
    with little_search(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(posterior_method, "Effort", lambda: _LITTLE)
        patch.setattr(information, "SAMPLES", 50)
        patch.setattr(information, "CANDIDATES", 100)
        patch.setattr(best_programs, "_LIKELY", 20)
        patch.setattr(information, "_MORE_DRAWS", 200)
        for module, name, little in _WEIGHING:
            patch.setattr(module, name, little)
        patch.setattr(simulator, "SAMPLES", 6)
        patch.setattr(simulator, "STEP", 1 / 120)
        patch.setattr(simulator, "_TRIED", 6)
        yield


@contextmanager
def usual_weighing() -> Iterator[None]:
    """Within little effort, where it must be no luck what comes out."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name, usual in _USUALLY:
            patch.setattr(module, name, usual)
        yield


if __name__ == "__main__":
    with little_effort():
        main()
