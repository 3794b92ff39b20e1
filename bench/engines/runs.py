"""Which engines simulate every body, in which worlds.

Two runs that differ in one thing, which should not matter to a resting pose, show how far an
engine agrees with itself. That is the most which agreement with it can mean.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from estimator.physics.base import Pair, Physics, WorldSettings
from estimator.physics.mujoco import MuJoCoPhysics
from estimator.physics.pybullet import PyBulletPhysics
from estimator.readings.observation import PredictedReadings

_COARSE: Final = WorldSettings()
_FINE: Final = WorldSettings(step=1 / 240, steps=1200, full_steps=True)
_INERT: Final = _FINE.least_inertia * (_COARSE.step / _FINE.step) ** 2  # as inert as at 1/60 s


_ENGINES: Final[dict[str, Callable[[WorldSettings], Physics]]] = {
    "pybullet": PyBulletPhysics,
    "mujoco": MuJoCoPhysics,
}


@dataclass(frozen=True, kw_only=True)
class Run:
    """One engine in one world.

    Attributes:
        engine: ``pybullet`` or ``mujoco``.
        settings: The world.
        nudged: The targets are 0.1° off.
        label: For people.
    """

    engine: str
    settings: WorldSettings
    label: str
    nudged: bool = False

    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        """Simulates one interaction per pair."""
        physics = _ENGINES[self.engine](self.settings)
        try:
            return physics.read(pairs)
        finally:
            physics.close()


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
"""By name. ``fine`` is the reference, ``coarse`` what models are simulated with."""

RIVALS: Final = ("fine", "inert", "coarse", "mujoco")
"""What statics is compared with."""

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
"""Causes of a disagreement: PyBullet comes to lie as statics says as soon as its world is so."""

KNOWN: Final = {
    "the step: PyBullet at 1/60 s lies as statics says": "coarse",
    "the engine: MuJoCo lies as statics says": "mujoco",
}
"""Causes that runs of all bodies show; looked at after the trials."""
