"""Why statics disagrees with the reference.

Statics is asked again with finer steps: where it then lies as the reference says, the cause is its
own. Each other body is simulated again in worlds that differ in one thing or two. The first in
which it comes to lie as statics says names the cause.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.engines.bodies import draw
from bench.engines.figures import CLOSE, Compared, differences
from bench.engines.runs import KNOWN, TRIALS
from estimator.physics.base import Pair, WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import PACE, StaticsPhysics
from estimator.readings.observation import PredictedReadings
from protocol.system.replace_file import replace_text

OWN: Final = f"statics itself: joint steps of {np.degrees(PACE):g}°"
UNEXPLAINED: Final = "unexplained"
_FINER: Final = PACE / 30


def cause(
    pair: Pair, computed: PredictedReadings, trials: Mapping[str, WorldSettings] = TRIALS
) -> str:
    """The first trial in which PyBullet agrees with statics, or ``UNEXPLAINED``.

    Args:
        pair: Body and motor program.
        computed: Its reading by statics, one row.
        trials: Worlds by the cause that they are to show.
    """
    for name, settings in trials.items():
        with PyBulletPhysics(settings) as physics:
            readings = physics.read([pair])
        if readings.valid[0] and differences(computed, readings)[0] <= CLOSE:
            return name
    return UNEXPLAINED


def list_causes(
    compared: Compared, seed: int, memory: Path, done: Callable[[], None]
) -> list[dict[str, Any]]:
    """Every disagreement of a problem with its poses and cause.

    Args:
        compared: The readings.
        seed: Of the comparison.
        memory: A file that remembers causes by body and pose, so that work goes on where it was.
        done: Called after each.
    """
    known: dict[str, str] = json.loads(memory.read_text("utf-8")) if memory.exists() else {}
    suspects = set(compared.suspects())
    rows = compared.disagreements()
    own = _own(compared, seed, rows)
    disagreements = []
    for row in rows:
        tilt = np.degrees(compared.statics.tilt[row])
        key = f"{row} {tilt.round(2).tolist()}"
        if row not in own and key not in known:
            _, pair, _ = draw(compared.problem, seed, row)
            known[key] = cause(pair, compared.statics[row : row + 1])
            replace_text(memory, json.dumps(known, indent=1))
        name = OWN if row in own else known[key]
        if name == UNEXPLAINED:
            name = _shown(compared, row) or UNEXPLAINED
        disagreements.append(
            {
                "problem": compared.problem,
                "seed": seed,
                "body": row,
                "statics_tilt_deg": tilt.round(2).tolist(),
                "reference_tilt_deg": np.degrees(compared.simulated["fine"].tilt[row])
                .round(2)
                .tolist(),
                "margin_deg": round(float(np.degrees(compared.margins[row])), 2),
                "suspect": row in suspects,
                "cause": name,
            }
        )
        done()
    return disagreements


def _own(compared: Compared, seed: int, rows: Sequence[int]) -> set[int]:
    """The rows on which statics with finer steps lies as the reference says."""
    with StaticsPhysics(pace=_FINER) as physics:
        readings = physics.read([draw(compared.problem, seed, row)[1] for row in rows])
    apart = differences(readings, compared.simulated["fine"][np.array(rows, dtype=int)])
    return {row for row, angle in zip(rows, apart, strict=True) if angle <= CLOSE}


def _shown(compared: Compared, row: int) -> str | None:
    """The cause that a run of all bodies shows, if one does."""
    return next((name for name, run in KNOWN.items() if compared.agrees(run)[row]), None)
