"""A back-end on a Dask cluster, for more cores than this computer has.

Each batch is cut into chunks, and a reading depends on its own pair only; so neither who did which
chunk shows in the result, nor whether it was done twice because a worker was lost.
"""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from typing import Final

from estimator.parallel.cluster import Cluster
from estimator.physics.base import Pair, Physics
from estimator.physics.pool import Chunk, ChunkedPhysics, MakePhysics, cut, read_chunk

_TASK: Final = "simulate"


class DaskPhysics(ChunkedPhysics):
    """Runs a back-end on the workers of a cluster, each of which keeps its engine.

    Args:
        make: Makes the back-end, on the worker; must be picklable, such as
            ``functools.partial(PyBulletPhysics, settings)``.
        cluster: The cluster; stays open.
        undecided: Whether the back-end tells undecided poses.
    """

    def __init__(self, make: MakePhysics, cluster: Cluster, *, undecided: bool = False) -> None:
        super().__init__(undecided=undecided)
        self._make = pickle.dumps(make)
        self._cluster = cluster

    def close(self) -> None:
        """Does nothing: workers keep their engines for the next run."""

    def _have_read(self, pairs: Sequence[Pair]) -> list[Chunk]:
        futures = []
        try:
            for chunk in cut(pairs, self._cluster.workers):
                futures.append(self._cluster.submit(_TASK, _simulate, self._make, chunk))
            return [self._cluster.result(future) for future in futures]
        except BaseException:
            self._cluster.cancel(futures)
            raise


_engine: tuple[bytes, Physics] | None = None  # the worker's own, and how it was made


def _simulate(make: bytes, pairs: Sequence[Pair]) -> Chunk:
    """Reads a chunk on a worker, which has one thread, so that nothing else uses the engine."""
    global _engine  # noqa: PLW0603  a worker process is one engine
    if _engine is None or _engine[0] != make:
        if _engine is not None:
            _engine[1].close()
            _engine = None
        _engine = make, pickle.loads(make)()
    return read_chunk(_engine[1], pairs)
