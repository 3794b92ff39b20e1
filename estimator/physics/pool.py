"""A back-end in worker processes, so that all cores simulate and no engine enters this process.

Each batch is cut into chunks that idle workers fetch one by one. A reading depends on its own pair
only, so neither the number of workers nor who did which chunk shows in the result.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final, TypeAlias

from estimator.errors import PhysicsError
from estimator.parallel.worker_processes import Work, WorkerProcesses
from estimator.physics.base import Abilities, BackEnd, Pair, Physics, Readings, sensor_count

CHUNK: Final = 25
"""Most simulations that a worker fetches at a time: about 0.2 s of work."""

MakePhysics: TypeAlias = Callable[[], Physics]
Chunk: TypeAlias = tuple[Readings, int, int]
"""Readings of a chunk, and the simulations and steps that they took."""


def cut(pairs: Sequence[Pair], workers: int) -> list[Sequence[Pair]]:
    """Cuts a batch into chunks, small enough for so many workers to share it evenly."""
    size = max(1, min(CHUNK, len(pairs) // (4 * max(1, workers))))
    return [pairs[start : start + size] for start in range(0, len(pairs), size)]


def read_chunk(physics: Physics, pairs: Sequence[Pair]) -> Chunk:
    """Reads a chunk and counts its simulations and steps."""
    simulations, steps = physics.simulations, physics.steps
    readings = physics.read(pairs)
    return readings, physics.simulations - simulations, physics.steps - steps


class ChunkedPhysics(BackEnd):
    """Base of back-ends that have others simulate their batches, chunk by chunk.

    Args:
        undecided: Whether those tell undecided poses.
    """

    def __init__(self, *, undecided: bool) -> None:
        super().__init__()
        self.abilities = Abilities(undecided=undecided)

    def read(self, pairs: Sequence[Pair]) -> Readings:
        """Simulates one interaction per pair; see ``Physics.read``.

        Raises:
            WorkerError: Several workers died of the same chunk; one that dies costs time.
            ClusterError: The cluster failed.
        """
        sensor_count(pairs)
        if not pairs:
            return Readings.empty(0, 0)
        chunks = self._have_read(pairs)
        self.simulations += sum(simulations for _, simulations, _ in chunks)
        self.steps += sum(steps for _, _, steps in chunks)
        return Readings.concatenate(readings for readings, _, _ in chunks)

    @abstractmethod
    def _have_read(self, pairs: Sequence[Pair]) -> list[Chunk]:
        """The chunks of a batch, in order."""


class PhysicsPool(ChunkedPhysics):
    """Runs a back-end in worker processes.

    Workers start with the first batch. A worker that dies costs time: its chunk is given to
    another one.

    Args:
        make: Makes the back-end, in the worker; must be picklable, such as
            ``functools.partial(PyBulletPhysics, settings)``.
        jobs: Number of workers.
        undecided: Whether the back-end tells undecided poses.

    Raises:
        PhysicsError: ``jobs`` is less than 1.
    """

    def __init__(self, make: MakePhysics, jobs: int, *, undecided: bool = False) -> None:
        super().__init__(undecided=undecided)
        if jobs < 1:
            raise PhysicsError(f"there must be at least one worker process, not {jobs}")
        self._jobs = jobs
        self._workers: WorkerProcesses[Sequence[Pair], None, Chunk] = WorkerProcesses(
            partial(_start, make), jobs
        )

    def close(self) -> None:
        """Ends the workers; may be called twice. The next batch starts new ones."""
        self._workers.close()

    def _have_read(self, pairs: Sequence[Pair]) -> list[Chunk]:
        return self._workers.results(cut(pairs, self._jobs))


def _start(make: MakePhysics) -> Work[Sequence[Pair], None, Chunk]:
    physics = make()
    return lambda pairs, _: read_chunk(physics, pairs)
