"""``make after``: poses on demand, changes noticed and named, on bodies that were identified first.

Each seed is one simulated robot of each body: it is identified through the wire, takes poses, is
watched while nothing happens, and is damaged through its control socket in one way after the other.
Every run is listed in ``docs/runs``.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median
from typing import Final

from pydantic import BaseModel

from bench.after_figures import DAMAGES, TOGETHER, Damaged, Reached
from bench.after_run import AfterRun
from bench.study_command import add_options, complete_by_command
from estimator.reproduction.harness import made_by
from estimator.reproduction.tables import markdown, write_csv
from estimator.use.diagnosis import Verdict
from estimator.use.pose import SAFE

ROBOTS: Final = tuple(
    f"{body}-{engine}"
    for body in ("quadruped", "unequal_legs")
    for engine in ("pybullet", "mujoco")
)
FOLDER: Final = Path(__file__).parents[1] / "docs" / "runs"


def tables(runs: Sequence[AfterRun], root: Path) -> str:
    """Table of how often each result came out as it should, in Markdown."""
    figures = [run.figures(root) for run in runs]
    damaged = [damage for robot in figures for damage in robot.damaged]
    undamaged = [damage for damage in damaged if not damage.fault]
    listed = [damage for damage in damaged if damage.fault in DAMAGES]
    novel = [damage for damage in damaged if damage.fault in TOGETHER]
    stumps = [damage for damage in listed if damage.share is not None]
    sized = [damage for damage in stumps if damage.right]
    alarms = [damage for damage in (*listed, *novel) if damage.noticed is not None]
    poses = [pose for robot in figures for pose in robot.poses]
    sure = [pose for pose in poses if pose.share >= 0.5]
    safe = [pose for pose in poses if pose.margin >= SAFE]
    none = Verdict.NONE_OF_THESE.value
    rows: list[tuple[str, Iterable[bool | int], int]] = [
        ("poses reached", (pose.reached for pose in poses), len(poses)),
        ("of goals called reachable, reached", (pose.reached for pose in sure), len(sure)),
        ("fell elsewhere, at a margin of 2° and more", (p.elsewhere for p in safe), len(safe)),
        (
            "false alarms, in so many movements",
            (robot.alarms for robot in figures),
            sum(robot.quiet for robot in figures),
        ),
        ("changes noticed", (1 for _ in alarms), len(listed) + len(novel)),
        (
            "the right cause among the monitor's three suspects",
            (damage.suspected for damage in alarms if damage.fault in DAMAGES),
            sum(damage.fault in DAMAGES for damage in alarms),
        ),
        ("right cause, alone or in a set of two", (damage.right for damage in listed), len(listed)),
        ("wrong cause", (damage.wrong for damage in listed), len(listed)),
        ("none of these, of the table", (damage.verdict == none for damage in listed), len(listed)),
        ("of these, legs", (damage.verdict == none for damage in stumps), len(stumps)),
        ("share of a leg within its 90 % interval", (damage.holds for damage in sized), len(sized)),
        (
            "a cause named, of two faults at once or one that the table lacks",
            (damage.wrong for damage in novel),
            len(novel),
        ),
        ("of these, moves as if", (damage.wrong and damage.as_if for damage in novel), len(novel)),
        ("undamaged robots called so", (robot.right for robot in undamaged), len(undamaged)),
    ]
    cells = ((name, str(sum(counted)), str(total)) for name, counted, total in rows)
    noticed = [damage.noticed for damage in alarms if damage.noticed is not None]
    return (
        f"{made_by(root, runs)} Movements until noticed: median {median(noticed or [0]):g}, "
        f"most {max(noticed, default=0)}.\n\n{markdown(('', '', 'of'), cells)}\n"
    )


def write_runs(runs: Sequence[AfterRun], root: Path, folder: Path) -> None:
    """Writes ``after.csv`` and ``after-poses.csv``: each damage, and each pose."""
    made = made_by(root, runs)
    kinds: tuple[tuple[str, type[BaseModel], str], ...] = (
        ("after", Damaged, "damaged"),
        ("after-poses", Reached, "poses"),
    )
    for name, kind, field in kinds:
        columns = [*kind.model_fields, *kind.model_computed_fields]
        rows = (
            (run.body, run.engine, run.seed, *map(_cell, outcome.model_dump().values()), made)
            for run in runs
            for outcome in getattr(run.figures(root), field)
        )
        write_csv(folder / f"{name}.csv", ("body", "engine", "seed", *columns, "commit"), rows)


def _cell(value: object) -> object:
    return "; ".join(map(str, value)) if isinstance(value, tuple) else value


def main() -> None:
    """Does the runs that are not finished, and writes the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser, Path("runs/after"))
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(1000, 1004)))
    parser.add_argument(
        "--faults", nargs="+", default=[*DAMAGES, *TOGETHER], choices=[*DAMAGES, *TOGETHER]
    )
    parser.add_argument("--goals", type=int, default=50, help="poses of each robot")
    parser.add_argument("--quiet", type=int, default=250, help="movements of each undamaged robot")
    parser.add_argument("--robots", nargs="+", default=ROBOTS, help="BODY-ENGINE (%(default)s)")
    parser.add_argument("--tables", type=Path, default=FOLDER, help="folder (%(default)s)")
    options = parser.parse_args()
    runs = [
        AfterRun(
            body=body,
            problem="topological",
            engine=engine,
            seed=seed,
            goals=options.goals,
            quiet=options.quiet,
            faults=tuple(options.faults),
        )
        for seed in options.seeds
        for body, _, engine in (robot.rpartition("-") for robot in options.robots)
    ]
    complete_by_command(runs, options.out, options)
    write_runs(runs, options.out, options.tables)
    print(tables(runs, options.out))


if __name__ == "__main__":
    main()
