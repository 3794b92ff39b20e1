"""``estimator``: identifies a robot's body, and says how good the result is.

Exit codes: 0 done, 1 failed (with a sentence), 2 wrong usage.
"""

from __future__ import annotations

from importlib import metadata
from typing import Annotated

import typer

from estimator.cli import (
    compare,
    doctor,
    export,
    identify,
    report,
    reproduce,
    resume,
    score,
    show,
    validate,
    watch,
)

app = typer.Typer(
    help="Identifies a robot's body from what it feels when it moves.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("identify")(identify.command)
app.command("resume")(resume.command)
app.command("show")(show.command)
app.command("score")(score.command)
app.command("report")(report.command)
app.command("compare")(compare.command)
app.command("validate")(validate.command)
app.command("export")(export.command)
app.command("watch")(watch.command)
app.command("doctor")(doctor.command)
app.command("reproduce")(reproduce.command)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"estimator (bodyschema) {metadata.version('bodyschema')}")
        raise typer.Exit


@app.callback()
def _before_any_command(
    *,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    pass
