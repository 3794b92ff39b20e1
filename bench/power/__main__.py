"""Does what is left to do of the study, and prints its tables: ``python -m bench.power --help``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Final

from bench.power.robots import BODIES, Robot, shipped
from bench.power.study import PICTURES, REPORTED, SEEDS, study
from bench.power.tables import by_group, overview, plot_success, write_tables
from bench.power.trial import Trial, TrialRun
from bench.prior_bodies import drawn_body
from bench.study_command import add_options, complete_by_command
from estimator.report.canvas import as_png
from estimator.reproduction.harness import made_by
from sim_robot.world.body import DEFAULT

DOCS: Final = Path(__file__).parents[2] / "docs"
BY_HAND: Final = "by hand"


def main(arguments: Sequence[str] | None = None) -> None:
    """Does the runs that are left and prints the tables; a run broken off begins anew."""
    parser = _parser()
    options = parser.parse_args(arguments)
    part = options.only or options.trial or options.problem or options.seeds != REPORTED
    part = part or options.first < len(SEEDS[REPORTED])
    if options.publish and part:
        parser.error("the tables are of the whole study: leave --publish out, or the others")
    if options.problem is None:
        groups = study(SEEDS[options.seeds])
        chosen = set(groups) if options.only is None else set(options.only)
        groups = {name: trials for name, trials in groups.items() if name in chosen}
    else:
        groups = {BY_HAND: (_by_hand(options),)}
    root = options.out / options.seeds
    runs = [
        run
        for group, trials in groups.items()
        for trial in trials
        if options.trial in trial.name
        for seed in trial.seeds[: options.first]
        for run in [TrialRun(group=group, trial=trial, seed=seed)]
        if run.is_finished(root) or not options.done
    ]
    complete_by_command(runs, root, options)
    done = by_group(runs, root)
    made = made_by(root, runs)
    print(overview(done, made))
    if options.publish:
        write_tables(done, DOCS / "runs", made)
        for group in set(PICTURES).intersection(done):
            (DOCS / "images" / PICTURES[group]).write_bytes(as_png(plot_success(done[group])))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", choices=SEEDS, default=REPORTED)
    parser.add_argument("--only", nargs="*", metavar="GROUP", help="default: all groups")
    parser.add_argument("--trial", default="", help="only trials whose name contains this")
    parser.add_argument("--first", type=int, default=30, help="only so many of a trial's seeds")
    parser.add_argument("--done", action="store_true", help="only runs that were made before")
    add_options(parser, Path("runs/power"))
    parser.add_argument(
        "--publish", action="store_true", help="write the tables and pictures of docs/accuracy.md"
    )
    hand = parser.add_argument_group("a trial that is not of the study")
    hand.add_argument("--problem", help="name, or file")
    hand.add_argument("--method", choices=("posterior", "paper"), default="posterior")
    hand.add_argument("--explore")
    hand.add_argument("--body", default=DEFAULT, help=f"name, file, prior, or {', '.join(BODIES)}")
    hand.add_argument("--engine", choices=("pybullet", "mujoco"), default="pybullet")
    hand.add_argument("--interactions", type=int, default=6)
    return parser


def _by_hand(options: argparse.Namespace) -> Trial:
    problem, name = options.problem, options.body
    body = partial(drawn_body, problem) if name == "prior" else BODIES.get(name) or shipped(name)
    text = Path(problem).read_text("utf-8") if problem.endswith(".toml") else problem
    settings = (options.method, options.explore, options.engine, options.interactions)
    return Trial(
        name=" ".join(str(word) for word in (problem, name, *settings) if word),
        seeds=SEEDS[options.seeds],
        problem=text,
        interactions=options.interactions,
        method=options.method,
        explore=options.explore,
        robot=Robot(body=body, options=("--engine", options.engine)),
    )


if __name__ == "__main__":
    main()
