"""Compares statics with PyBullet and MuJoCo, and both with themselves."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.markdown import Markdown

from bench.engines.figures import Compared, figures, list_causes
from bench.engines.page import plot_differences, plot_risk, publish, tables, write_csv
from bench.engines.runs import PROBLEMS, Piece, draw, load, pieces
from bench.study_command import add_options, complete_by_command
from estimator.cli.console import err, errors_as_sentences
from estimator.cli.screen import Screen
from estimator.physics.statics import StaticsPhysics
from estimator.reproduction.harness import made_by

_ROOT: Final = Path(__file__).parents[2]
_PICTURES: Final = (
    ("statics-differences.png", plot_differences),
    ("statics-risk.png", plot_risk),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Simulates what is missing and writes tables and plots; returns the exit status."""
    options = _options(arguments)
    console = Console()
    work = {name: pieces(name, options.seed, options.bodies) for name in options.problems}
    everything = [piece for of_problem in work.values() for piece in of_problem]
    everything.sort(key=lambda piece: piece.start)  # all problems grow alike
    complete_by_command(everything, options.out, options)
    with errors_as_sentences(None):
        compared = [_compared(finished, options.out, options.bodies) for finished in work.values()]
        causes = _explain(compared, work, options)
    problems = [figures(item) for item in compared]
    command = f"make compare-engines BODIES={options.bodies} SEED={options.seed}"
    measured = f"{tables(problems, causes, command)}\n{made_by(options.out, everything)}\n"
    report = {"command": command, "problems": problems, "disagreements": causes}
    (options.out / "engines.json").write_text(json.dumps(report, indent=1), encoding="utf-8")
    (options.out / "engines.md").write_text(measured, encoding="utf-8")
    write_csv(options.out / "engines.csv", problems)
    for name, plot in _PICTURES:
        plot(options.out / name, compared)
        if options.publish:
            plot(_ROOT / "docs" / "images" / name, compared)
    if options.publish:
        publish(_ROOT / "docs" / "physics.md", measured)
    if console.is_terminal:
        console.print(Markdown(measured))
    else:
        print(measured)
    console.print(f"Tables, figures (CSV, JSON) and plots are in {options.out}.")
    return 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make compare-engines", description=__doc__)
    parser.add_argument("--problems", nargs="+", choices=PROBLEMS, default=PROBLEMS)
    parser.add_argument("--bodies", type=int, default=1000, help="of each problem (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of bodies and poses (%(default)s)")
    add_options(parser, Path("runs/engines"))
    parser.add_argument(
        "--publish", action="store_true", help="put tables and plots into docs/physics.md"
    )
    options = parser.parse_args(arguments)
    for name in ("bodies", "jobs"):
        if getattr(options, name) < 1:
            parser.error(f"--{name} must be at least 1")
    if options.seed < 0:
        parser.error("--seed must be at least 0")
    return options


def _compared(finished: list[Piece], root: Path, bodies: int) -> Compared:
    problem, seed = finished[0].problem, finished[0].seed
    pairs = [draw(problem, seed, number)[1] for number in range(bodies)]
    with StaticsPhysics() as physics:
        return Compared(
            problem=problem,
            statics=physics.read(pairs),
            margins=physics.path_margins(pairs),
            simulated=load(finished, root, bodies),
        )


def _explain(
    compared: Sequence[Compared], work: dict[str, list[Piece]], options: argparse.Namespace
) -> list[dict[str, Any]]:
    causes: list[dict[str, Any]] = []
    with Screen(err) as screen:
        screen.expect(sum(len(item.disagreements()) for item in compared), 0)
        for item in compared:
            memory = work[item.problem][0].file(options.out).parents[1] / "causes.json"
            causes += list_causes(
                item, options.seed, memory, lambda: screen.worked(1, "disagreements explained")
            )
    return causes


if __name__ == "__main__":
    raise SystemExit(main())
