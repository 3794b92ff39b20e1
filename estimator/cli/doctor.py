"""``estimator doctor``: whether a robot can be identified, and why not."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.text import Text

from estimator.cli.console import errors_as_sentences, out
from estimator.cli.examination import ExaminedItem, Fitness, examine
from estimator.cli.options import Keys


def command(
    *,
    robot: Annotated[str, typer.Option(help="tcp://HOST:PORT: robotd, or sim-robotd.")],
    keys: Keys = None,
) -> None:
    """Find out whether a robot can be identified, and why not; moves nothing."""
    with errors_as_sentences(None):
        verdicts = [_print_finding(finding) for finding in examine(robot, keys)]
    if Fitness.BAD in verdicts:
        raise typer.Exit(1)


def _print_finding(finding: ExaminedItem) -> Fitness:
    colour = {Fitness.FINE: "green", Fitness.NOTE: "yellow", Fitness.BAD: "red"}[finding.verdict]
    line = Text.assemble(
        (f"{finding.verdict.value:<6}", colour), f"{finding.subject:<13}", finding.sentence
    )
    out.print(line, soft_wrap=True)
    return finding.verdict
