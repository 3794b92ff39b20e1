"""Simulates bodies in all engines, piece by piece; each piece is a run of a study."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from bench.engines.bodies import draw
from bench.engines.runs import RUNS
from estimator.physics.base import Pair
from estimator.readings.observation import PredictedReadings
from estimator.reproduction.harness import BriefRun
from protocol.system.native_output import native_output_discarded
from protocol.system.replace_file import replace_file

PIECE: Final = 20
"""Bodies simulated at a time, in all runs: some seconds of work."""

Simulated: TypeAlias = dict[str, PredictedReadings]
"""Readings of the same bodies in each run."""


@dataclass(frozen=True, kw_only=True)
class Piece(BriefRun):
    """Bodies ``start`` to ``start + size`` of a problem."""

    leaves = "readings.npz"

    problem: str
    seed: int
    start: int
    size: int

    @property
    def name(self) -> str:
        """Its own, and another one in other worlds."""
        return f"{_worlds()}-seed-{self.seed}/{self.problem}/{self.start:06d}-{self.size}"

    def make(self, place: Path) -> None:
        """Leaves the readings of its bodies in all runs."""
        drawn = [draw(self.problem, self.seed, self.start + row) for row in range(self.size)]
        simulated = simulate_here(
            [pair for _, pair, _ in drawn], [nudged for _, _, nudged in drawn]
        )
        arrays: dict[str, Any] = {
            f"{run}:{item.name}": getattr(readings, item.name)
            for run, readings in simulated.items()
            for item in fields(PredictedReadings)
        }
        replace_file(place / self.leaves, lambda fresh: np.savez_compressed(fresh, **arrays))


def pieces(problem: str, seed: int, bodies: int) -> list[Piece]:
    """The pieces that so many bodies are made of; the last may hold more than is asked for."""
    size = min(PIECE, bodies)
    return [
        Piece(problem=problem, seed=seed, start=start, size=size)
        for start in range(0, bodies, size)
    ]


def simulate_here(pairs: Sequence[Pair], nudged: Sequence[Pair]) -> Simulated:
    """All runs of some bodies, in this process."""
    with native_output_discarded():
        return {name: run.read(nudged if run.nudged else pairs) for name, run in RUNS.items()}


def load(finished: Sequence[Piece], root: Path, bodies: int) -> Simulated:
    """Loads the simulated readings of the first bodies; ``root`` is the study's directory."""
    parts: dict[str, list[PredictedReadings]] = {name: [] for name in RUNS}
    for piece in finished:
        with np.load(piece.file(root)) as arrays:
            for name in RUNS:
                parts[name].append(_unpacked(arrays, name))
    return {
        name: PredictedReadings.concatenate(readings)[:bodies] for name, readings in parts.items()
    }


def _unpacked(arrays: Mapping[str, Any], run: str) -> PredictedReadings:
    return PredictedReadings(
        **{item.name: arrays[f"{run}:{item.name}"] for item in fields(PredictedReadings)}
    )


@cache
def _worlds() -> str:
    """Names the runs and the engines' versions: what was simulated otherwise is not mixed in.

    Whoever changes a back-end itself has to delete the folder.
    """
    versions = [metadata.version(engine) for engine in ("pybullet", "mujoco")]
    return hashlib.sha256(repr((RUNS, versions)).encode()).hexdigest()[:8]
