"""``estimator``: identifies a robot's body, and says how good the result is.

Exit codes: 0 done, 1 failed (with a sentence), 2 wrong usage, 3 ``monitor`` found the body changed.
"""

from __future__ import annotations

from importlib import metadata
from typing import Annotated

import typer

from estimator.cli import doctor, evaluate, identify, live, reproduce, results, resume, use

app = typer.Typer(
    help="Identifies a robot's body from what its sensors read when it moves.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("identify")(identify.command)
app.command("resume")(resume.command)
app.command("show")(results.show)
app.command("score")(evaluate.score)
app.command("report")(results.report)
app.command("compare")(results.compare)
app.command("validate")(evaluate.validate)
app.command("pose")(use.pose)
app.command("monitor")(use.monitor)
app.command("diagnose")(use.diagnose)
app.command("export")(results.export)
app.command("watch")(live.watch)
app.command("doctor")(doctor.doctor)
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
