"""Physics back-ends by name, opened in the calling process or in workers.

Another package adds a back-end by an entry point in the group ``bodyschema.physics``: a class that
derives from ``Physics``, or from ``ArrayPhysics``.
"""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any, Final, TypeAlias, cast

from estimator.errors import EstimatorError
from estimator.physics.base import ArrayPhysics, Pair, Physics, WorldSettings, sensor_count
from estimator.physics.statics import StaticsPhysics
from estimator.plugins import Registry
from estimator.readings.observation import PredictedReadings

REFERENCE: Final = "mujoco" if find_spec("pybullet") is None else "pybullet"
"""The back-end that has the last word on models, whatever searched for them: PyBullet where it is
installed. A run records which it is."""

BACKENDS: Final[Registry[Any]] = Registry(
    kind="physics",
    group="bodyschema.physics",
    own=MappingProxyType(
        {
            "pybullet": "estimator.physics.pybullet:PyBulletPhysics",
            "mujoco": "estimator.physics.mujoco:MuJoCoPhysics",
            "statics": "estimator.physics.statics:StaticsPhysics",
        }
    ),
)

MakePhysics: TypeAlias = Callable[[], Physics]

_CHUNK_SIZE: Final = 25  # most simulations that a worker fetches at a time: about 0.2 s of work
_FEWEST_CHUNKS: Final = 32  # fewest chunks of a batch that has as many pairs; not tuned
_Chunk: TypeAlias = tuple[PredictedReadings, int, int]  # readings, simulations, steps


def physics_class(name: str) -> type[Physics]:
    """Returns the class of a back-end.

    Raises:
        EstimatorError: There is no such back-end, or it cannot be used.
    """
    back_end = BACKENDS.load(name)
    if not (isinstance(back_end, type) and issubclass(back_end, Physics)):
        raise EstimatorError(
            f"the physics {BACKENDS.described(name)} must be a class that derives from "
            "estimator.Physics or estimator.ArrayPhysics"
        )
    missing = sorted(back_end.__abstractmethods__)
    if missing:
        raise EstimatorError(
            f"the physics {BACKENDS.described(name)} has no method {' nor '.join(missing)}"
        )
    return back_end


def maker(name: str, settings: WorldSettings) -> partial[Physics]:
    """Returns a picklable function that makes a back-end in the process that calls it.

    Raises:
        EstimatorError: There is no such back-end, or it cannot be used.
    """
    return partial(cast(Callable[..., Physics], physics_class(name)), settings)


def open_arrays(name: str, settings: WorldSettings, *, jobs: int = 1) -> ArrayPhysics:
    """Opens a back-end that takes arrays, on ``jobs`` cores of the calling process.

    Raises:
        EstimatorError: There is no such back-end, it cannot be used, or it takes no arrays.
    """
    if not issubclass(physics_class(name), ArrayPhysics):
        raise EstimatorError(f"the physics {BACKENDS.described(name)} is no estimator.ArrayPhysics")
    make = cast(Callable[..., ArrayPhysics], maker(name, settings))
    return make() if jobs == 1 else make(jobs=jobs)


def open_predicting(name: str, settings: WorldSettings, *, jobs: int = 1) -> ArrayPhysics:
    """Opens the back-end that predicts for a run: its own if that takes arrays, else statics.

    Raises:
        EstimatorError: There is no such back-end, or it cannot be used.
    """
    takes_arrays = issubclass(physics_class(name), ArrayPhysics)
    return open_arrays(name if takes_arrays else "statics", settings, jobs=jobs)


def approximation_of(name: str, settings: WorldSettings) -> ArrayPhysics | None:
    """Returns a fast approximation of a back-end; ``None`` if the back-end is as fast itself.

    Raises:
        EstimatorError: There is no such back-end, or it cannot be used.
    """
    return None if issubclass(physics_class(name), ArrayPhysics) else StaticsPhysics(settings)


def in_workers(name: str, settings: WorldSettings, workers: Executor) -> Physics:
    """Opens a back-end in workers, which may have other work, too."""
    return PhysicsPool(maker(name, settings), workers)


def in_this_process(name: str, settings: WorldSettings) -> Physics:
    """Opens a back-end in the calling process."""
    return maker(name, settings)()


class PhysicsPool(Physics):
    """Runs a back-end in workers, each of which makes it with its first chunk and keeps it.

    Each batch is cut into chunks, which idle workers are given one by one. A reading depends on its
    own pair only, so neither the number of workers nor who did which chunk shows in the result, nor
    whether it was done twice because a worker was lost.

    Args:
        make: Makes the back-end, in the worker; must be picklable, such as
            ``functools.partial(PyBulletPhysics, settings)``.
        workers: Executor that does the work; it stays open.
    """

    def __init__(self, make: MakePhysics, workers: Executor) -> None:
        super().__init__()
        self._read_chunk = partial(_read_chunk, pickle.dumps(make))
        self._workers = workers

    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        """Simulates one interaction per pair; see ``Physics.read``.

        Raises:
            WorkerError: Several workers died of the same chunk; one that dies costs time.
            ClusterError: The cluster failed.
        """
        sensor_count(pairs)
        if not pairs:
            return PredictedReadings.empty(0, 0)
        chunks = list(self._workers.map(self._read_chunk, _chunks_of(pairs)))
        self.simulations += sum(simulations for _, simulations, _ in chunks)
        self.steps += sum(steps for _, _, steps in chunks)
        return PredictedReadings.concatenate(readings for readings, _, _ in chunks)


def _chunks_of(pairs: Sequence[Pair]) -> list[Sequence[Pair]]:
    """Cuts a batch into chunks, small enough for several workers to share it evenly."""
    size = max(1, min(_CHUNK_SIZE, len(pairs) // _FEWEST_CHUNKS))
    return [pairs[start : start + size] for start in range(0, len(pairs), size)]


class _Kept(threading.local):
    """The engine of a worker, and what made it, pickled; one thread only can use an engine."""

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
