"""How often the posterior is right, and whether it knows: ``python -m bench.power``; resumable.

Robots are simulated (PyBullet at 1/240 s, noise on) and reached through the protocol. After every
interaction the leading attachments are held against the truth, up to what no sensor can tell apart.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.stats import binomtest

from estimator.body.limbs import leg_lengths
from estimator.evaluation.attachments import Comparison, Truth
from estimator.evaluation.length_search import LengthSearch
from estimator.evaluation.score import length_search
from estimator.identification.listener import Listener
from estimator.identification.run import Order, identify, problem_of, resume, world_of
from estimator.physics.backends import in_this_process
from estimator.physics.statics import StaticsPhysics
from estimator.problem.genome import Genome
from estimator.report.run_files import write_report
from estimator.reproduction.runs.robot_process import RobotProcess, catch_up, print_body
from estimator.storage.database import holds_run
from estimator.storage.store import RunStore

SEEDS: Final = range(1000, 1030)
FIGURES: Final = "power.json"
SURE: Final = 0.95


def run(seed: int, problem: str, interactions: int, folder: Path) -> dict[str, Any]:
    """One run, and how right it was after each interaction; what was done is not repeated."""
    place = folder / str(seed)
    figures = place / FIGURES
    if figures.exists():
        return dict(json.loads(figures.read_text()))
    report = partial(write_report, plots=False)
    with RobotProcess(seed) as robot:
        if holds_run(place):
            with RunStore.open(place) as store:
                catch_up(store, robot.uri)
            result = resume(place, in_this_process, Listener(), robot=robot.uri, report=report)
        else:
            order = Order(robot=robot.uri, problem=problem, seed=seed, interactions=interactions)
            result = identify(place, order, in_this_process, Listener(), report=report)
    with RunStore.open(place, to_write=False) as store:
        steps = held_against(store, folder / "truth.urdf")
    told = {
        "seed": seed,
        "seconds": result.wall_seconds,
        "simulations": result.simulations_run,
        "explained": result.posterior is not None and result.posterior.explained,
        "steps": steps,
    }
    figures.write_text(json.dumps(told, indent=2))
    return told


def held_against(store: RunStore, truth: Path) -> list[dict[str, Any]]:
    """The leading attachments and the lengths after each interaction, beside the true ones."""
    problem = problem_of(store)
    genome = Genome(problem, problem.base(store.capabilities))
    known = Truth.read(truth, problem, store.capabilities)
    legs = np.array([leg.limb.length for leg in known.legs.values()])
    search: LengthSearch | None = None
    steps = []
    with StaticsPhysics(world_of(store, problem)) as physics:
        for belief, _ in store.beliefs():
            body = genome.decode(np.array(belief.best))
            comparison = Comparison(problem, genome, body, known)
            search = search or length_search(store, problem, comparison.true_body, physics)
            cells = comparison.configurations(search.is_like)
            lengths = leg_lengths(genome.decode_all(np.array(belief.genes)))
            low, high = np.quantile(
                lengths, (0.05, 0.95), axis=0, weights=belief.weights, method="inverted_cdf"
            )
            steps.append(
                {
                    "right": all(cell.right_up_to_equivalence for cell in cells),
                    "cells_right": sum(cell.right_up_to_equivalence for cell in cells),
                    "probability": belief.probability,
                    "leg_errors_mm": (1000 * (leg_lengths([body])[0] - legs)).tolist(),
                    "inside": ((low <= legs) & (legs <= high)).tolist(),
                }
            )
    return steps


def table(runs: Iterable[dict[str, Any]]) -> str:
    """What the runs say, as Markdown."""
    told = sorted(runs, key=lambda one: int(one["seed"]))
    count = len(told)
    lines = [
        "| after interaction | right | 95 % interval | stated ≥ 0.95 | of these right | "
        "mean leg error (mm) | legs inside their 90 % interval |",
        "|---|---|---|---|---|---|---|",
    ]
    for at in range(max(len(one["steps"]) for one in told)):
        steps = [one["steps"][at] for one in told if at < len(one["steps"])]
        right = sum(step["right"] for step in steps)
        low, high = binomtest(right, len(steps)).proportion_ci(method="wilson")
        sure = [step for step in steps if step["probability"] >= SURE]
        errors = np.abs([error for step in steps for error in step["leg_errors_mm"]])
        inside = [one for step in steps for one in step["inside"]]
        lines.append(
            f"| {at + 1} | {right} of {len(steps)} | {100 * low:.0f}–{100 * high:.0f} % | "
            f"{len(sure)} | {sum(step['right'] for step in sure)} | {errors.mean():.1f} | "
            f"{sum(inside)} of {len(inside)} |"
        )
    seconds = [one["seconds"] for one in told]
    simulations = [one["simulations"] for one in told]
    unexplained = [str(one["seed"]) for one in told if not one["explained"]]
    lines += [
        "",
        f"{count} runs; median {np.median(seconds):.0f} s and {np.median(simulations):,.0f} "
        f"simulations each; no body said to explain the readings in seeds: "
        f"{', '.join(unexplained) or 'none'}.",
        "",
        "| seed | right after | stated after each interaction |",
        "|---|---|---|",
    ]
    for one in told:
        marks = "".join("■" if step["right"] else "□" for step in one["steps"])
        stated = ", ".join(f"{step['probability']:.2f}" for step in one["steps"])
        lines.append(f"| {one['seed']} | {marks} | {stated} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Runs the study and prints its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problem", default="topological")
    parser.add_argument("--interactions", type=int, default=6)
    parser.add_argument("--seeds", type=int, nargs="*", default=list(SEEDS))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("runs/power"))
    options = parser.parse_args()
    folder = options.out / f"{options.problem}-{options.interactions}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "truth.urdf").write_text(print_body(), encoding="utf-8")
    work = partial(run, problem=options.problem, interactions=options.interactions, folder=folder)
    runs = []
    with ProcessPoolExecutor(options.jobs) as workers:
        for one in workers.map(work, options.seeds):
            runs.append(one)
            last = one["steps"][-1]
            print(
                f"seed {one['seed']}: {'right' if last['right'] else 'wrong'}, stated "
                f"{last['probability']:.2f}, {one['seconds']:.0f} s",
                flush=True,
            )
    text = table(runs)
    (folder / "table.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
