"""The verdict on fit, as a person reads it in a terminal."""

from __future__ import annotations

from typing import Final

from rich.console import Console
from rich.text import Text

from estimator.report.posterior.summary import PosteriorSummary
from estimator.report.result import FitFound

WHAT_TO_CHECK: Final = (
    "Check that the problem describes this robot: where legs can sit, how thick parts are and "
    "of what shape, units, the order and direction of the servos, the sign of the tilts, whether "
    "every servo moves and holds its angle, each foot's gauge, and whether the ground is level."
)


def print_verdict(console: Console, judged: PosteriorSummary | FitFound) -> None:
    """Whether any body explains the readings and, where none does, what to check."""
    if judged.explained:
        console.print(Text(judged.verdict))
    else:
        console.print(Text(judged.verdict, style="bold red"))
        console.print(WHAT_TO_CHECK)
