"""``make parametric``: the parametric problem at the paper's budget, on the reported seeds.

Each seed is one simulated robot and one run, by the commands a user would type; every run is
listed. Writes ``docs/parametric.md``.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.progress import track

from estimator.reproduction.runs.robot_process import RobotProcess, print_body

SEEDS = range(1000, 1010)
ROOT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent
PAGE = ROOT / "docs" / "parametric.md"

HEAD = """# What the parametric search finds

`make parametric` wrote this page: `estimator identify --method paper --problem parametric` at the
paper's budget
(population 100, 10 generations, four random motor programs in ±30°, touch, tilt and clearance,
models simulated in PyBullet), one simulated quadruped with default noise per seed. Seeds
{first}–{last} were fixed before the first run; every run is listed. Truth: four legs of 220 mm.

A leg that never touched the ground in any of the four poses cannot be felt, so its length is little
better than chance; the user is warned about it, and it stands apart here. *Signed* is the mean of
estimated − true over the four legs: it would show a bias from radius, length definition or joints
that miss their targets.
"""


def _estimator(*arguments: str) -> None:
    command = [str(BIN / "estimator"), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"estimator {' '.join(arguments)}: {done.stderr}")


def run(seed: int, folder: Path, truth: Path) -> dict[str, Any]:
    """One run, validated and scored; what was done already is not repeated."""
    place = folder / str(seed)
    figures = place / "figures.json"
    if not figures.exists():
        with RobotProcess(seed) as robot:
            known = (place / "run.sqlite").exists()
            start = (
                ["resume", str(place)]
                if known
                else ["identify", "--method", "paper", "--problem", "parametric"]
            )
            rest = [] if known else ["--seed", str(seed), "--out", str(place)]
            _estimator(*start, "--robot", robot.uri, *rest)
            _estimator("validate", str(place), "--robot", robot.uri)
        score = subprocess.run(
            [BIN / "estimator", "score", str(place), "--truth", str(truth), "--json"],
            capture_output=True,
            text=True,
            check=True,
        )
        figures.write_text(score.stdout, encoding="utf-8")
    return {
        "score": json.loads(figures.read_text("utf-8")),
        "result": json.loads((place / "result.json").read_text("utf-8")),
        "validation": json.loads((place / "validation.json").read_text("utf-8")),
    }


def main() -> None:
    """Runs every seed and writes the page."""
    folder = Path("runs") / "parametric"
    folder.mkdir(parents=True, exist_ok=True)
    truth = folder / "truth.urdf"
    truth.write_text(print_body(), encoding="utf-8")
    start = time.monotonic()
    runs = {seed: run(seed, folder, truth) for seed in track(list(SEEDS), "seeds")}
    minutes = (time.monotonic() - start) / 60
    PAGE.write_text(page(runs, minutes), encoding="utf-8")
    print(f"{PAGE.relative_to(ROOT)} is written; the runs are in {folder}")


def page(runs: dict[int, dict[str, Any]], minutes: float) -> str:
    """The page as markdown."""
    lines = [HEAD.format(first=SEEDS[0], last=SEEDS[-1]), *_table(runs), "", *_predictions(runs)]
    requested = statistics.mean(r["result"]["simulations_requested"] for r in runs.values())
    simulated = statistics.mean(r["result"]["simulations_run"] for r in runs.values())
    lines.append(
        f"\nSimulations per run: {requested:.0f} requested, {simulated:.0f} run on average. "
        f"All runs together took {minutes:.0f} minutes on two cores.\n"
    )
    return "\n".join(lines)


def _table(runs: dict[int, dict[str, Any]]) -> list[str]:
    rows = [
        "## Leg lengths (mm)",
        "",
        "| seed | mean error | legs that touched | legs that never did | signed | sensor error |",
        "|---|---|---|---|---|---|",
    ]
    touched: list[float] = []
    never: list[float] = []
    signed: list[float] = []
    for seed, run in runs.items():
        score = run["score"]
        errors = [1000 * error for error in score["leg_errors_m"]]
        mine = [error for error, bit in zip(errors, score["touched"], strict=True) if bit]
        others = [error for error, bit in zip(errors, score["touched"], strict=True) if not bit]
        touched += mine
        never += others
        signed.append(1000 * statistics.mean(score["leg_errors_signed_m"]))
        rows.append(
            f"| {seed} | {statistics.mean(errors):.1f} | {_mean(mine)} | {_mean(others)} "
            f"| {signed[-1]:+.1f} | {run['result']['sensor_error']:.2f} |"
        )
    everything = touched + never
    rows.append(
        f"| **all** | **{statistics.mean(everything):.1f}** | **{_mean(touched)}** "
        f"| **{_mean(never)}** | **{statistics.mean(signed):+.1f}** "
        f"(SD {statistics.stdev(signed):.1f}) | |"
    )
    rows.append(f"\n{len(touched)} legs touched, {len(never)} never did.")
    return rows


def _predictions(runs: dict[int, dict[str, Any]]) -> list[str]:
    rows = [
        "## Prediction on 20 fresh motor programs",
        "",
        "Mean over the seeds; predicted first, then performed.",
        "",
        "| models | touch wrong (%) | tilt (°) | clearance (mm) |",
        "|---|---|---|---|",
    ]
    for key, name in (
        ("best_model", "best model"),
        ("population_median", "population, median"),
        ("random_models", "random models, median"),
    ):
        predictions = [run["validation"][key] for run in runs.values()]
        touch, tilt, clearance = (
            statistics.mean(item[field] for item in predictions)
            for field in ("touch", "tilt_deg", "clearance_mm")
        )
        rows.append(f"| {name} | {100 * touch:.1f} | {tilt:.2f} | {clearance:.1f} |")
    return rows


def _mean(values: Sequence[float]) -> str:
    return f"{statistics.mean(values):.1f}" if values else "–"


if __name__ == "__main__":
    main()
