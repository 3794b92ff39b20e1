"""``estimator compare``: runs side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from estimator.cli.console import errors_as_sentences, out, unless_unwritable
from estimator.report.canvas import as_png
from estimator.report.comparison import ComparedRun, comparison_picture, joints_of
from estimator.report.tables import number, percent, plain_table
from protocol.system.replace_file import replace_bytes

_NONE: Final = "–"


def command(
    directories: Annotated[
        list[Path], typer.Argument(help="Run directories, two or more.", metavar="DIR DIR...")
    ],
    picture: Annotated[
        Path, typer.Option("--out", metavar="FILE", dir_okay=False, help="The picture, a PNG.")
    ] = Path("comparison.png"),
) -> None:
    """Compare runs, finished or not, as a table and as a picture."""
    if len(directories) < 2:
        raise typer.BadParameter("give two run directories or more")
    if picture.suffix.lower() != ".png":
        raise typer.BadParameter(f"the picture is a PNG: let --out {picture} end in .png")
    with errors_as_sentences(None):
        runs = [ComparedRun.read(directory) for directory in directories]
        _print_runs(runs)
        _print_lengths(runs)
        for place, run in enumerate(runs, 1):
            if not run.result.complete:
                out.print(f"Run {place} is not finished: what it knows so far.", soft_wrap=True)
        with unless_unwritable(picture.absolute().parent):
            replace_bytes(picture, as_png(comparison_picture(runs)))
            out.print(f"Picture: {picture}", soft_wrap=True)


def _print_runs(runs: list[ComparedRun]) -> None:
    table = plain_table("run", *(f"{place}" for place in range(1, len(runs) + 1)), justify="left")
    rows = [_summary(run) for run in runs]
    for name in rows[0]:
        table.add_row(name, *(row[name] for row in rows))
    out.print(table)


def _summary(run: ComparedRun) -> dict[str, str]:
    result, posterior, score = run.result, run.result.posterior, run.score
    sure = None if posterior is None else posterior.probability
    explained = None if result.judged is None else result.judged.explained
    return {
        "directory": run.name,
        "state": "complete" if result.complete else "not finished",
        "problem": result.problem,
        "robot": str(result.robot["robot"]),
        "method": f"{result.method}, {result.physics}",
        "modalities": ", ".join(result.modalities),
        "seed": str(result.seed),
        "interactions": str(result.interactions),
        "readings explained": _NONE if explained is None else "yes" if explained else "NO",
        "attachments sure to": _NONE if sure is None else percent(sure),
        "subjective error": number(result.sensor_error, 3),
        "mean leg error (mm)": _NONE if score is None else number(1000 * score.mean_leg_error_m, 1),
        "configurations right": _NONE
        if score is None
        else f"{score.configurations_right} of {score.configurations_total}",
        "simulations": f"{result.simulations_run:,}",
        "time (s)": f"{result.wall_seconds:.0f}",
    }


def _print_lengths(runs: list[ComparedRun]) -> None:
    """Of the best bodies."""
    joints = joints_of(runs)
    if not joints:
        return
    places = range(1, len(runs) + 1)
    table = plain_table("length (mm)", *map(str, places), justify="left")
    for joint in joints:
        lengths = [run.lengths.get(joint) for run in runs]
        table.add_row(
            joint,
            *(
                _NONE
                if one is None
                else f"{1000 * one.median:.1f} ({1000 * one.low:.1f}–{1000 * one.high:.1f})"
                for one in lengths
            ),
        )
    out.print(table)
    out.print("In brackets: the 90 % interval; of the method paper, the range in its population.")
