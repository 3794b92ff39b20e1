"""Which engines simulate which bodies, in which worlds.

Two runs that differ in one thing, which should not matter to a resting pose, show how far an
engine agrees with itself. Nothing can be expected to agree with it better. Bodies and motor
programs are random, each from a seed of its own. Each piece of work is a run of a study.
"""

from __future__ import annotations

import hashlib
import math
import zlib
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from bench.prior_bodies import drawn_genes, on_robot
from estimator.body.morphology import Morphology
from estimator.physics.backends import in_this_process
from estimator.physics.base import Pair, WorldSettings
from estimator.readings.observation import PredictedReadings
from estimator.reproduction.harness import BriefRun
from protocol.system.files import replace_file
from protocol.system.process import native_output_discarded

_COARSE: Final = WorldSettings()
_FINE: Final = WorldSettings(step=1 / 240, steps=1200, full_steps=True)
_INERT: Final = _FINE.least_inertia * (_COARSE.step / _FINE.step) ** 2  # as inert as at 1/60 s


@dataclass(frozen=True, kw_only=True)
class Run:
    """One engine in one world.

    Attributes:
        engine: ``pybullet`` or ``mujoco``.
        settings: The world.
        nudged: Whether the targets are 0.1° off.
        label: Name for people.
    """

    engine: str
    settings: WorldSettings
    label: str
    nudged: bool = False


RUNS: Final = {
    "fine": Run(engine="pybullet", settings=_FINE, label="PyBullet, 1/240 s"),
    "coarse": Run(engine="pybullet", settings=_COARSE, label="PyBullet, 1/60 s"),
    "inert": Run(
        engine="pybullet",
        settings=replace(_FINE, least_inertia=_INERT),
        label="PyBullet, 1/240 s, inertia as at 1/60 s",
    ),
    "friction": Run(
        engine="pybullet",
        settings=replace(_COARSE, friction=0.5),
        label="PyBullet, 1/60 s, friction 0.5",
    ),
    "slew": Run(
        engine="pybullet",
        settings=replace(_COARSE, slew=math.radians(30)),
        label="PyBullet, 1/60 s, slew 30°/s",
    ),
    "targets": Run(
        engine="pybullet",
        settings=_COARSE,
        nudged=True,
        label="PyBullet, 1/60 s, targets ± 0.1°",
    ),
    "mujoco": Run(engine="mujoco", settings=_FINE, label="MuJoCo, 1/240 s"),
}
"""Runs by name. ``fine`` is the reference; models are simulated as in ``coarse``."""

RIVALS: Final = ("fine", "inert", "coarse", "mujoco")
"""Runs that statics is compared with."""

CEILINGS: Final = (
    ("step", "coarse", "fine", "PyBullet: 1/60 s or 1/240 s"),
    ("friction", "friction", "coarse", "PyBullet: friction 0.5 or 0.7"),
    ("slew", "slew", "coarse", "PyBullet: slew 30°/s or 60°/s"),
    ("targets", "targets", "coarse", "PyBullet: targets 0.1° off"),
    ("inertia", "inert", "fine", "PyBullet: 16 times the least inertia"),
    ("engine", "mujoco", "fine", "MuJoCo or PyBullet, 1/240 s"),
)
"""Pairs of runs that differ in one thing: name, the two runs, and what differs."""

_SLOW: Final = replace(_FINE, slew=math.radians(60) / 8, steps=2400)
TRIALS: Final = {
    "time: at rest only after 10 s": replace(_FINE, steps=2400),
    "momentum: slew eight times slower": _SLOW,
    "inertia: a sixteenth, at 1/960 s": replace(_FINE, step=1 / 960, steps=4800),
    "inertia and momentum: at 1/960 s, slew eight times slower": replace(
        _SLOW, step=1 / 960, steps=9600
    ),
    "sliding: friction 5": replace(_FINE, friction=5.0),
}
"""Worlds by cause of a disagreement: the first in which a body lies as statics says names it."""

KNOWN: Final = {
    "the step: PyBullet at 1/60 s lies as statics says": "coarse",
    "the engine: MuJoCo lies as statics says": "mujoco",
}
"""Causes that runs of all bodies show; looked at after the trials."""


PROBLEMS: Final = ("parametric", "topological", "topological-20", "topological-24")
NUDGE: Final = np.radians(0.1)
"""How far off a target may be for a reading to count, rad."""


PIECE: Final = 20
"""Number of bodies simulated at a time, in all runs: some seconds of work."""

Simulated: TypeAlias = dict[str, PredictedReadings]
"""Readings of the same bodies in each run."""


def draw(name: str, seed: int, number: int) -> tuple[Morphology, Pair, Pair]:
    """Draws a body of a problem: genes and motor program uniform where they are allowed.

    Args:
        name: Name of the problem.
        seed: Seed of the comparison.
        number: Number of the body; it does not depend on how many others are drawn.

    Returns:
        The body; the body with its motor program; and the body with each target 0.1° off, to either
        side.
    """
    problem, genome, capabilities = on_robot(name)
    rng = np.random.default_rng([seed, zlib.crc32(name.encode()), number])
    body = genome.decode(drawn_genes(genome, rng))
    program = problem.random_program(rng, capabilities)
    nudged = program + NUDGE * rng.choice([-1.0, 1.0], len(program)) * (program != 0)
    return body, (body, program), (body, nudged)


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
        """Name, unique in the study; another one if worlds or engines are others."""
        return f"{_worlds()}-seed-{self.seed}/{self.problem}/{self.start:06d}-{self.size}"

    def make(self, place: Path) -> None:
        """Writes the readings of its bodies in all runs."""
        drawn = [draw(self.problem, self.seed, self.start + row) for row in range(self.size)]
        arrays: dict[str, Any] = {}
        with native_output_discarded():
            for name, run in RUNS.items():
                pairs = [nudged if run.nudged else pair for _, pair, nudged in drawn]
                with closing(in_this_process(run.engine, run.settings)) as physics:
                    readings = physics.read(pairs)
                for item in fields(PredictedReadings):
                    arrays[f"{name}:{item.name}"] = getattr(readings, item.name)
        replace_file(place / self.leaves, lambda fresh: np.savez_compressed(fresh, **arrays))


def pieces(problem: str, seed: int, bodies: int) -> list[Piece]:
    """Pieces that hold so many bodies; the last may hold more than is asked for."""
    size = min(PIECE, bodies)
    return [
        Piece(problem=problem, seed=seed, start=start, size=size)
        for start in range(0, bodies, size)
    ]


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
    """Digest of the runs and engines' versions, so that what was simulated otherwise stays apart.

    Whoever changes a back-end itself has to delete the folder.
    """
    versions = [metadata.version(engine) for engine in ("pybullet", "mujoco")]
    return hashlib.sha256(repr((RUNS, versions)).encode()).hexdigest()[:8]
