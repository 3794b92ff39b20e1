"""How far statics and the engines agree: differences, shares, and why they differ.

For the cause, statics is computed again with finer steps: where the body then lies as the reference
says, the cause is statics itself. Each other body is simulated again in worlds that differ in one
thing or two. The first in which it comes to lie as statics says names the cause.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.engines.runs import CEILINGS, KNOWN, RIVALS, TRIALS, Simulated, draw
from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.physics.base import Pair, WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import PACE, StaticsPhysics
from estimator.readings.observation import PredictedReadings
from estimator.reproduction import paper_claims
from protocol.system.files import replace_text

CLOSE: Final = 0.5
"""Largest difference of the tilts of poses that count as the same, degrees."""
COVERED: Final = 0.85
"""Share of the poses, those with the largest margins, that count as sure."""
STILL: Final = 1e-3
"""Speed below which a main body counts as at rest, m/s."""


OWN: Final = f"statics itself: joint steps of {np.degrees(PACE):g}°"
UNEXPLAINED: Final = "unexplained"
_FINER: Final = PACE / 30


@dataclass(frozen=True, kw_only=True)
class Compared:
    """All readings of the bodies of one problem.

    Attributes:
        problem: Name of the problem.
        statics: Readings by statics.
        margins: Path margins, rad, shape (n,).
        simulated: Readings by each run.
    """

    problem: str
    statics: PredictedReadings
    margins: Array
    simulated: Simulated

    def counted(self, run: str) -> Flags:
        """Where both statics and a run have a reading that counts, shape (n,)."""
        return self.statics.valid & ~self.statics.undecided & self.simulated[run].valid

    def differences(self, run: str) -> Array:
        """Difference of tilt between statics and a run, degrees, shape (n,)."""
        return differences(self.statics, self.simulated[run])

    def least_margin(self) -> float:
        """The margin that the surest 85 % of the decided poses have, rad."""
        decided = self.margins[self.statics.valid & ~self.statics.undecided]
        return float(np.quantile(decided, 1 - COVERED)) if decided.size else 0.0

    def agrees(self, run: str) -> Flags:
        """Where a run and statics find the same pose, shape (n,)."""
        return self.counted(run) & (self.differences(run) <= CLOSE)

    def disagreements(self) -> list[int]:
        """Bodies on which statics and the reference, ``fine``, disagree."""
        differ = self.counted("fine") & (self.differences("fine") > CLOSE)
        return [int(row) for row in np.flatnonzero(differ)]

    def suspects(self) -> list[int]:
        """Disagreements with large margins on which the engines agree with each other."""
        coarse, fine, mujoco = (self.simulated[run] for run in ("coarse", "fine", "mujoco"))
        agreed = (differences(coarse, fine) <= CLOSE) & (differences(mujoco, fine) <= CLOSE)
        agreed &= coarse.valid & mujoco.valid & (self.margins >= self.least_margin())
        return [row for row in self.disagreements() if agreed[row]]


def differences(one: PredictedReadings, other: PredictedReadings) -> Array:
    """The larger difference of the two tilts, degrees, shape (n,)."""
    angles: Array = np.degrees(np.max(np.abs(one.tilt - other.tilt), axis=1, initial=0.0))
    return angles


def share(close: Flags) -> dict[str, float]:
    """Share of flags that are true, with the ends of its 95 % interval (Wilson's)."""
    count = len(close)
    if not count:
        return {"n": 0, "share": math.nan, "low": math.nan, "high": math.nan}
    interval = paper_claims.share(int(np.sum(close)), count)
    return {"n": count, "share": float(np.mean(close)), "low": interval.low, "high": interval.high}


def risk_coverage(compared: Compared, run: str) -> tuple[Array, Array]:
    """Share of poses kept, surest first, and the share of those that disagree by over 0.5°.

    Poses with equal margins, such as the largest there is, have no order: each counts as the mean
    of them.
    """
    counted = compared.counted(run)
    differ = (compared.differences(run)[counted] > CLOSE).astype(float)
    _, tie, sizes = np.unique(-compared.margins[counted], return_inverse=True, return_counts=True)
    rate = np.bincount(tie, differ, minlength=len(sizes)) / sizes
    wrong = np.repeat(rate, sizes)
    kept = np.arange(1, len(wrong) + 1)
    return kept / max(1, len(wrong)), np.cumsum(wrong) / kept


def figures(compared: Compared) -> dict[str, Any]:
    """Everything that is reported of one problem, for JSON."""
    statics = compared.statics
    return {
        "problem": compared.problem,
        "bodies": len(statics),
        "undecided": int(np.sum(statics.undecided)),
        "margin_of_85_percent_deg": math.degrees(compared.least_margin()),
        "statics_and": {run: _against(compared, run) for run in RIVALS},
        "ceilings": {
            name: _pair(compared.simulated[one], compared.simulated[two])
            for name, one, two, _ in CEILINGS
        },
    }


def _against(compared: Compared, run: str) -> dict[str, Any]:
    counted = compared.counted(run)
    sure = counted & (compared.margins >= compared.least_margin())
    engine = compared.simulated[run]
    at_rest = counted & (engine.speed < STILL)
    angles = compared.differences(run)
    kept, risk = risk_coverage(compared, run)
    points = [0.5, 0.7, COVERED, 0.95, 1.0]
    rows = [max(0, math.ceil(point * len(kept)) - 1) for point in points] if len(kept) else []
    lift = np.abs(compared.statics.clearance - engine.clearance)[counted] * 1e3
    return {
        "invalid": int(np.sum(~engine.valid)),
        "moving": int(np.sum(engine.valid & (engine.speed >= STILL))),
        "within": share(angles[counted] <= CLOSE),
        "within_where_sure": share(angles[sure] <= CLOSE),
        "within_where_still": share(angles[at_rest] <= CLOSE),
        "median_deg": _quantile(angles[counted], 0.5),
        "quantile_95_deg": _quantile(angles[counted], 0.95),
        "median_clearance_mm": _quantile(lift, 0.5),
        "touch_alike": _touch(compared.statics, engine, counted),
        "risk_at_coverage": {
            f"{point:g}": float(risk[row]) for point, row in zip(points, rows, strict=False)
        },
    }


def _pair(one: PredictedReadings, two: PredictedReadings) -> dict[str, Any]:
    counted = one.valid & two.valid
    angles = differences(one, two)[counted]
    return {
        "within": share(angles <= CLOSE),
        "median_deg": _quantile(angles, 0.5),
        "touch_alike": _touch(one, two, counted),
    }


def _touch(one: PredictedReadings, two: PredictedReadings, counted: Flags) -> float:
    """Share of touch bits that are alike."""
    alike = (one.touch == two.touch)[counted]
    return float(np.mean(alike)) if alike.size else math.nan


def _quantile(values: Array, part: float) -> float:
    return float(np.quantile(values, part)) if values.size else math.nan


def cause(
    pair: Pair, computed: PredictedReadings, trials: Mapping[str, WorldSettings] = TRIALS
) -> str:
    """The first trial in which PyBullet agrees with statics, or ``UNEXPLAINED``.

    Args:
        pair: Body and motor program.
        computed: Reading of the body by statics, one row.
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
        seed: Seed of the comparison.
        memory: File that remembers causes by body and pose, so that work goes on where it was.
        done: Called after each disagreement.
    """
    remembered: dict[str, str] = json.loads(memory.read_text("utf-8")) if memory.exists() else {}
    suspects = set(compared.suspects())
    rows = compared.disagreements()
    statics_rows = _rows_of_statics(compared, seed, rows)
    disagreements = []
    for row in rows:
        tilt = np.degrees(compared.statics.tilt[row])
        key = f"{row} {tilt.round(2).tolist()}"
        if row not in statics_rows and key not in remembered:
            _, pair, _ = draw(compared.problem, seed, row)
            remembered[key] = cause(pair, compared.statics[row : row + 1])
            replace_text(memory, json.dumps(remembered, indent=1))
        name = OWN if row in statics_rows else remembered[key]
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


def _rows_of_statics(compared: Compared, seed: int, rows: Sequence[int]) -> set[int]:
    """The rows on which statics with finer steps lies as the reference says."""
    with StaticsPhysics(pace=_FINER) as physics:
        readings = physics.read([draw(compared.problem, seed, row)[1] for row in rows])
    angles = differences(readings, compared.simulated["fine"][np.array(rows, dtype=int)])
    return {row for row, angle in zip(rows, angles, strict=True) if angle <= CLOSE}


def _shown(compared: Compared, row: int) -> str | None:
    """The cause that a run of all bodies shows, if one does."""
    return next((name for name, run in KNOWN.items() if compared.agrees(run)[row]), None)
