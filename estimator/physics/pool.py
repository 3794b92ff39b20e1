"""A back-end in worker processes, so that all cores simulate and no engine enters this process.

Each batch is cut into chunks that idle workers fetch one by one. A reading depends on its own pair
only, so neither the number of workers nor who did which chunk shows in the result.
Workers are started fresh (``forkserver``), because forking a process with threads is unsafe.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Final, TypeAlias

from estimator.errors import PhysicsError, WorkerError
from estimator.parallel.child_process import end_with_parent, interrupts_blocked, silence_stdout
from estimator.physics.base import Abilities, BackEnd, Pair, Physics, Readings, sensor_count

CHUNK: Final = 25
"""Most simulations that a worker fetches at a time: about 0.2 s of work."""

_ATTEMPTS: Final = 3

MakePhysics: TypeAlias = Callable[[], Physics]
_Chunk: TypeAlias = tuple[Readings, int, int]


def cut(pairs: Sequence[Pair], workers: int) -> list[Sequence[Pair]]:
    """Chunks of a batch, small enough for so many workers to share it evenly."""
    size = max(1, min(CHUNK, len(pairs) // (4 * max(1, workers))))
    return [pairs[start : start + size] for start in range(0, len(pairs), size)]


class PhysicsPool(BackEnd):
    """Runs a back-end in worker processes.

    Workers start with the first batch. A worker that dies costs time: its chunk is given to
    another one.

    Args:
        make: Makes the back-end, in the worker; must be picklable, such as
            ``functools.partial(PyBulletPhysics, settings)``.
        jobs: Number of workers.
        undecided: Whether the back-end tells undecided poses.

    Raises:
        PhysicsError: There are no workers to be.
    """

    def __init__(self, make: MakePhysics, jobs: int, *, undecided: bool = False) -> None:
        super().__init__()
        self.abilities = Abilities(undecided=undecided)
        if jobs < 1:
            raise PhysicsError(f"there must be at least one worker process, not {jobs}")
        self._make = make
        self._jobs = jobs
        self._executor: ProcessPoolExecutor | None = None

    def close(self) -> None:
        """Ends the workers after their present chunks; may be called twice."""
        if self._executor is not None:
            executor, self._executor = self._executor, None
            executor.shutdown(wait=True, cancel_futures=True)

    def read(self, pairs: Sequence[Pair]) -> Readings:
        """Simulates one interaction per pair; see ``Physics.read``.

        Raises:
            WorkerError: Workers died again and again while nothing got done.
        """
        sensor_count(pairs)
        if not pairs:
            return Readings.empty(0, 0)
        chunks = cut(pairs, self._jobs)
        done: dict[int, _Chunk] = {}
        failures = 0
        while len(done) < len(chunks):
            before = len(done)
            try:
                self._fetch(chunks, done)
            except BrokenProcessPool as error:
                self.close()
                failures = 0 if len(done) > before else failures + 1
                if failures == _ATTEMPTS:
                    raise WorkerError(
                        f"worker processes died {_ATTEMPTS} times in a row, perhaps for lack of "
                        "memory: free some, or use fewer --jobs"
                    ) from error
            except BaseException:
                self.close()
                raise
        self.simulations += sum(simulations for _, simulations, _ in done.values())
        self.steps += sum(steps for _, _, steps in done.values())
        return Readings.concatenate(done[index][0] for index in range(len(chunks)))

    def _fetch(self, chunks: Sequence[Sequence[Pair]], done: dict[int, _Chunk]) -> None:
        """Has the missing chunks computed; keeps what was finished when a worker dies."""
        with interrupts_blocked():
            if self._executor is None:
                self._executor = ProcessPoolExecutor(
                    self._jobs,
                    mp_context=multiprocessing.get_context("forkserver"),
                    initializer=_start_worker,
                    initargs=(self._make,),
                )
            waiting: dict[int, Future[_Chunk]] = {
                index: self._executor.submit(_work, chunk)
                for index, chunk in enumerate(chunks)
                if index not in done
            }
        broken: BrokenProcessPool | None = None
        for index, future in waiting.items():
            try:
                done[index] = future.result()
            except BrokenProcessPool as error:
                broken = error
        if broken is not None:
            raise broken


_physics: Physics | Exception | None = None  # the worker's own back-end, or why there is none


def _start_worker(make: MakePhysics) -> None:
    global _physics  # noqa: PLW0603  a worker process is one engine
    silence_stdout()
    end_with_parent()
    try:
        _physics = make()
    except Exception as error:
        _physics = error  # raised in an initializer it would look like a dead worker


def _work(chunk: Sequence[Pair]) -> _Chunk:
    if isinstance(_physics, Exception):
        raise _physics
    if _physics is None:
        raise PhysicsError("a worker was asked to work before it was started")
    simulations, steps = _physics.simulations, _physics.steps
    readings = _physics.read(chunk)
    return readings, _physics.simulations - simulations, _physics.steps - steps
