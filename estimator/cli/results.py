"""``estimator report``, ``compare`` and ``export``: what runs have found."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from estimator.cli.console import (
    errors_as_sentences,
    out,
    unless_unwritable,
)
from estimator.cli.options import Directory
from estimator.errors import EstimatorError, RunDirectoryError
from estimator.posterior.fitted import FittedPosterior
from estimator.report.canvas import as_png
from estimator.report.comparison import ComparedRun, comparison_picture, joints_of
from estimator.report.export.formats import BODY_FORMATS, BodyFormat, Exported, in_words_of
from estimator.report.page.run_page import run_page
from estimator.report.result import PAGE
from estimator.report.run_files import write_files
from estimator.report.summarise import summarise
from estimator.report.tables import between, mm, number, percent, plain_table
from estimator.reproduction.report import reproduction_page
from estimator.storage.store import RunStore
from protocol.system.files import replace_bytes, replace_text


def report(
    directory: Directory,
    *,
    paper: Annotated[
        bool, typer.Option("--paper", help="DIR is what estimator reproduce made.")
    ] = False,
    file: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Default: report.html and plots in DIR."),
    ] = None,
) -> None:
    """Write report.html: the body to be turned and posed, and all that is known of it."""
    page_file = file or directory / PAGE
    with errors_as_sentences(None):
        if paper:
            replace_text(page_file, reproduction_page(directory))
        else:
            _write_run(directory, file)
    out.print(f"Report: {page_file}", soft_wrap=True)


def _write_run(directory: Path, file: Path | None) -> None:
    with RunStore.open(directory, to_write=False) as store:
        result = summarise(store)
        if not result.complete:
            out.print("The run is not finished: the report says what is known so far.")
        if file is None:
            try:
                write_files(store, result, page=True)
            except OSError as error:
                raise RunDirectoryError(
                    f"{directory} cannot be written ({error.strerror}): say where the report is "
                    "to go, with --out FILE."
                ) from error
        else:
            html, _ = run_page(store, result)
            replace_text(file, html)


_DASH: Final = "–"


def compare(
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
    probability = None if posterior is None else posterior.probability
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
        "readings explained": _DASH if explained is None else "yes" if explained else "NO",
        "probability of attachments": _DASH if probability is None else percent(probability),
        "subjective error": number(result.sensor_error, 3),
        "best body's mean leg error (mm)": _DASH
        if score is None
        else number(1000 * score.mean_leg_error_m, 1),
        "configurations right": _DASH
        if score is None
        else f"{score.configurations_right} of {score.configurations_total}",
        "simulations": f"{result.simulations_run:,}",
        "time (s)": f"{result.wall_seconds:.0f}",
    }


def _print_lengths(runs: list[ComparedRun]) -> None:
    """Prints the leg lengths of the runs, over all their samples."""
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
                _DASH if length is None else f"{mm(length.median)} ({between(length, 1000)})"
                for length in lengths
            ),
        )
    out.print(table)
    out.print("In brackets: the 90 % interval; of the method paper, the range in its population.")


def export(
    directory: Directory,
    form: Annotated[BodyFormat, typer.Option("--format", help="Of the file, or files.")],
    sample: Annotated[
        int, typer.Option(min=0, help="Another than the best model (0): 1 is the second best.")
    ] = 0,
    place: Annotated[
        Path | None,
        typer.Option("--out", help="File, or of ros2 the folder of packages. Default: print it."),
    ] = None,
) -> None:
    """Write a run's best model, or another one, as URDF, MJCF, JSON or a package for ROS 2."""
    is_folder = form is BodyFormat.ROS2
    if is_folder and place is None:
        raise typer.BadParameter("ros2 is a folder of files: --out says where to put it, say src")
    if not is_folder and place is not None and place.is_dir():
        raise typer.BadParameter(f"--out: {place} is a directory, and {form} is one file")
    with errors_as_sentences(None):
        content = exported(directory, form, sample)
        files = {"": content} if isinstance(content, str) else content
        for path, text in files.items():
            if place is None:
                typer.echo(text, nl=False)
            else:
                replace_text(place / path, text)


def exported(directory: Path, form: BodyFormat, sample: int) -> Exported:
    """Returns a model of a run, written in a format.

    Raises:
        EstimatorError: The run has no such model.
    """
    with RunStore.open(directory, to_write=False) as store:
        fitted = FittedPosterior.of(store)
    if fitted is None:
        raise EstimatorError(f"{directory} has no model yet: resume the run first")
    count = len(fitted.model_points)
    if sample >= count:
        raise EstimatorError(
            f"{directory} holds {count} models, so there is no sample {sample}: choose 0 to "
            f"{count - 1}"
        )
    (body,) = fitted.bodies_at(fitted.model_points[fitted.ranked[[sample]]])
    return BODY_FORMATS[form](in_words_of(fitted.problem, fitted.capabilities, body))
