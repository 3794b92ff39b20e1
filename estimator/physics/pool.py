"""A back-end in workers, so that all cores simulate.

Each batch is cut into chunks, which idle workers are given one by one. A reading depends on its
own pair only, so neither the number of workers nor who did which chunk shows in the result, nor
whether it was done twice because a worker was lost.
"""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from typing import Final, TypeAlias

from estimator.physics.base import Abilities, BackEnd, Pair, Physics, Readings, sensor_count

MakePhysics: TypeAlias = Callable[[], Physics]

_CHUNK: Final = 25  # most simulations that a worker fetches at a time: about 0.2 s of work
_CHUNKS: Final = 32  # of a batch, at least, as long as it has so many pairs
_Chunk: TypeAlias = tuple[Readings, int, int]  # and the simulations and steps that they took


class PhysicsPool(BackEnd):
    """Runs a back-end in workers, each of which makes it with its first chunk and keeps it.

    Args:
        make: Makes the back-end, in the worker; must be picklable, such as
            ``functools.partial(PyBulletPhysics, settings)``.
        workers: Do the work; stay open.
        undecided: Whether the back-end tells undecided poses.
    """

    def __init__(self, make: MakePhysics, workers: Executor, *, undecided: bool = False) -> None:
        super().__init__()
        self.abilities = Abilities(undecided=undecided)
        self._read_chunk = partial(_read_chunk, pickle.dumps(make))
        self._workers = workers

    def read(self, pairs: Sequence[Pair]) -> Readings:
        """Simulates one interaction per pair; see ``Physics.read``.

        Raises:
            WorkerError: Several workers died of the same chunk; one that dies costs time.
            ClusterError: The cluster failed.
        """
        sensor_count(pairs)
        if not pairs:
            return Readings.empty(0, 0)
        chunks = list(self._workers.map(self._read_chunk, _cut(pairs)))
        self.simulations += sum(simulations for _, simulations, _ in chunks)
        self.steps += sum(steps for _, _, steps in chunks)
        return Readings.concatenate(readings for readings, _, _ in chunks)

    def close(self) -> None:
        """Does nothing: the workers are the caller's."""


def _cut(pairs: Sequence[Pair]) -> list[Sequence[Pair]]:
    """Cuts a batch into chunks, small enough for several workers to share it evenly."""
    size = max(1, min(_CHUNK, len(pairs) // _CHUNKS))
    return [pairs[start : start + size] for start in range(0, len(pairs), size)]


class _Kept(threading.local):
    """The engine of a worker, and how it was made; an engine can be used by one thread only."""

    engine: tuple[bytes, Physics] | None = None


_kept: Final = _Kept()


def _read_chunk(make: bytes, pairs: Sequence[Pair]) -> _Chunk:
    """Reads a chunk, in a worker."""
    if _kept.engine is None or _kept.engine[0] != make:
        if _kept.engine is not None:
            _kept.engine[1].close()
            _kept.engine = None
        _kept.engine = make, pickle.loads(make)()
    physics = _kept.engine[1]
    simulations, steps = physics.simulations, physics.steps
    readings = physics.read(pairs)
    return readings, physics.simulations - simulations, physics.steps - steps
