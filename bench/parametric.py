"""``make parametric``: the parametric problem at the paper's budget, on the reported seeds.

Each seed is one simulated robot and one run; every run is listed. Writes ``docs/parametric.md``.
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from bench.study_command import add_options, complete_by_command
from estimator.evaluation.validate import BEST, POPULATION, RANDOM, PredictionErrors, Validation
from estimator.readings.modalities import MODALITIES
from estimator.report.evaluations import TRUTH
from estimator.reproduction.harness import made_by
from estimator.reproduction.paper_runs import (
    ALL_MODALITIES,
    PREDICTIONS,
    SEEDS,
    Budget,
    PlannedRun,
    Summary,
)
from estimator.reproduction.robot_process import print_body

PAGE = Path(__file__).parents[1] / "docs" / "parametric.md"

HEAD = """# What the parametric search finds

`make parametric` wrote this page: `estimator identify --method paper --problem parametric` at the
paper's budget
(population 100, 10 generations, four random motor programs in ±30°, touch, tilt and clearance,
models simulated in PyBullet), one simulated quadruped with default noise per seed. Seeds
{first}–{last} were fixed before the first run; every run is listed. Truth: four legs of 220 mm.

A leg that never touched the ground in any of the four poses is unmeasured, so its length is little
better than chance; the user is warned about it, and it stands apart here. *Signed* is the mean of
estimated − true over the four legs: it would show a bias from radius, length definition or joints
that miss their targets.
"""


RUNS: Final = tuple(
    PlannedRun(
        problem="parametric",
        variant=ALL_MODALITIES,
        seed=seed,
        budget=Budget(),
        predicts=PREDICTIONS,
    )
    for seed in SEEDS[:10]
)


def main() -> None:
    """Does the runs that are not finished, and writes the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser, Path("runs/parametric"))
    options = parser.parse_args()
    complete_by_command(RUNS, options.out, options, shared={TRUTH: print_body})
    runs = {run.seed: Summary.read(run, options.out) for run in RUNS}
    PAGE.write_text(page(runs, made_by(options.out, RUNS)), encoding="utf-8")
    print(f"{PAGE.name} is written; the runs are in {options.out}")


def page(runs: Mapping[int, Summary], made: str) -> str:
    """The page as Markdown.

    Args:
        runs: Finished runs, by seed.
        made: A sentence that names the commits which made them.
    """
    results = [run.result for run in runs.values() if run.result is not None]
    requested = statistics.mean(result.simulations_requested for result in results)
    simulated = statistics.mean(result.simulations_run for result in results)
    return "\n".join(
        [
            HEAD.format(first=min(runs), last=max(runs)),
            *_table(runs),
            "",
            *_predictions([run.validation for run in runs.values() if run.validation is not None]),
            f"\nSimulations per run: {requested:.0f} requested, {simulated:.0f} run on average. "
            f"{made}\n",
        ]
    )


def _table(runs: Mapping[int, Summary]) -> list[str]:
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
        assert run.score is not None
        assert run.result is not None
        errors = [1000 * error for error in run.score.leg_errors_m]
        by_touch = list(zip(errors, run.score.touched, strict=True))
        mine, others = (
            [error for error, bit in by_touch if bool(bit) == own] for own in (True, False)
        )
        touched += mine
        never += others
        signed.append(1000 * run.score.mean_signed_leg_error_m)
        rows.append(
            f"| {seed} | {statistics.mean(errors):.1f} | {_mean(mine)} | {_mean(others)} "
            f"| {signed[-1]:+.1f} | {run.result.sensor_error:.2f} |"
        )
    everything = touched + never
    rows.append(
        f"| **all** | **{statistics.mean(everything):.1f}** | **{_mean(touched)}** "
        f"| **{_mean(never)}** | **{statistics.mean(signed):+.1f}** "
        f"(SD {statistics.stdev(signed):.1f}) | |"
    )
    rows.append(f"\n{len(touched)} legs touched, {len(never)} never did.")
    return rows


def _predictions(validations: Sequence[Validation]) -> list[str]:
    rows = [
        "## Prediction on 20 fresh motor programs",
        "",
        "Mean over the seeds; predicted first, then performed.",
        "",
        "| models | touch wrong (%) | tilt (°) | clearance (mm) |",
        "|---|---|---|---|",
    ]
    for key, name in (
        (BEST, "best model"),
        (POPULATION, "population, median"),
        (RANDOM, "random models, median"),
    ):
        errors: list[PredictionErrors] = [getattr(item, key) for item in validations]
        touch, tilt, clearance = (
            statistics.mean(one[modality.error_name] or 0.0 for one in errors)
            for modality in MODALITIES.values()
        )
        rows.append(f"| {name} | {100 * touch:.1f} | {tilt:.2f} | {clearance:.1f} |")
    return rows


def _mean(values: Sequence[float]) -> str:
    return f"{statistics.mean(values):.1f}" if values else "–"


if __name__ == "__main__":
    main()
