"""Simulates what was not simulated yet, in worker processes; each piece of work is one file."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from importlib import metadata
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from bench.engines.bodies import draw
from bench.engines.runs import RUNS
from estimator.parallel.worker_processes import Raised, Work, WorkerProcesses
from estimator.physics.base import Pair, Readings
from protocol.system.files import replace_file
from protocol.system.process import native_output_discarded

PIECE: Final = 20
"""Bodies simulated at a time, in all runs: some seconds of work."""

Simulated: TypeAlias = dict[str, Readings]
"""Readings of the same bodies in each run."""


@dataclass(frozen=True, kw_only=True)
class Piece:
    """Bodies ``start`` to ``start + size`` of a problem."""

    problem: str
    seed: int
    start: int
    size: int
    path: Path


def pieces(folder: Path, problem: str, seed: int, bodies: int) -> list[Piece]:
    """The pieces that so many bodies are made of; the last may hold more than is asked for."""
    place = folder / f"{_worlds()}-seed-{seed}" / problem
    size = min(PIECE, bodies)
    return [
        Piece(
            problem=problem,
            seed=seed,
            start=start,
            size=size,
            path=place / f"{start:06d}-{size}.npz",
        )
        for start in range(0, bodies, size)
    ]


def simulate(missing: Sequence[Piece], jobs: int, done: Callable[[], None]) -> None:
    """Simulates pieces; when interrupted, those that are under way are lost.

    Args:
        missing: What to simulate.
        jobs: Number of worker processes.
        done: Called after each piece.
    """
    workers: WorkerProcesses[Piece, None, None]
    with WorkerProcesses(_start, jobs) as workers:
        for _, event in workers.do(missing):
            if isinstance(event, Raised):
                raise event.error
            done()


def _start() -> Work[Piece, None, None]:
    return lambda piece, _: _simulate_one(piece)


def _simulate_one(piece: Piece) -> None:
    drawn = [draw(piece.problem, piece.seed, piece.start + row) for row in range(piece.size)]
    simulated = simulate_here([pair for _, pair, _ in drawn], [nudged for _, _, nudged in drawn])
    arrays: dict[str, Any] = {
        f"{run}:{item.name}": getattr(readings, item.name)
        for run, readings in simulated.items()
        for item in fields(Readings)
    }
    replace_file(piece.path, lambda fresh: np.savez_compressed(fresh, **arrays))


def simulate_here(pairs: Sequence[Pair], nudged: Sequence[Pair]) -> Simulated:
    """All runs of some bodies, in this process."""
    with native_output_discarded():
        return {name: run.read(nudged if run.nudged else pairs) for name, run in RUNS.items()}


def load(finished: Sequence[Piece], bodies: int) -> Simulated:
    """Loads the simulated readings of the first bodies."""
    parts: dict[str, list[Readings]] = {name: [] for name in RUNS}
    for piece in finished:
        with np.load(piece.path) as arrays:
            for name in RUNS:
                parts[name].append(_unpacked(arrays, name))
    return {name: Readings.concatenate(readings)[:bodies] for name, readings in parts.items()}


def _unpacked(arrays: Mapping[str, Any], run: str) -> Readings:
    return Readings(**{item.name: arrays[f"{run}:{item.name}"] for item in fields(Readings)})


def _worlds() -> str:
    """Names the runs and the engines' versions: what was simulated otherwise is not mixed in.

    Whoever changes a back-end itself has to delete the folder.
    """
    versions = [metadata.version(engine) for engine in ("pybullet", "mujoco")]
    return hashlib.sha256(repr((RUNS, versions)).encode()).hexdigest()[:8]
