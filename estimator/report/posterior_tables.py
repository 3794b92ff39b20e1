"""A posterior as a person reads it in a terminal: the verdict on fit first."""

from __future__ import annotations

from typing import Final

from rich.console import Console
from rich.text import Text

from estimator.report.plain_table import plain_table
from estimator.report.posterior_summary import Interval, PosteriorSummary
from estimator.report.result import Result

_CHECK: Final = (
    "Check that the problem describes this robot: where legs can sit, radii, units, the order and "
    "direction of the servos, the sign of the tilts, and whether the servos hold their angles."
)


def print_posterior(console: Console, result: Result, posterior: PosteriorSummary) -> None:
    """The verdict, the body with its probabilities, rivals, how it was found, what it cost."""
    if posterior.explained:
        console.print(posterior.verdict)
    else:
        console.print(Text(posterior.verdict, style="bold red"))
        console.print(_CHECK)
    state = "complete" if result.complete else "not finished"
    console.print(
        Text.assemble(
            *("Problem ", (result.problem, "bold"), f", seed {result.seed}, "),
            f"{', '.join(result.modalities)}; posterior by {result.physics}; {state}.",
        )
    )
    _print_attachments(console, posterior)
    table = plain_table("leg", "side", "length (mm)", "90 % interval (mm)", "touched")
    for leg, length in zip(result.legs, posterior.lengths_m, strict=True):
        touched = "not sensed" if leg.touched is None else "yes" if leg.touched else "never"
        table.add_row(leg.joint, leg.side, _mm(length.median), _between(length, 1000), touched)
    console.print(table)
    _print_rivals(console, posterior)
    _print_steps(console, posterior)
    factors = "; ".join(
        f"{name} {factor.median:.1f} times what the robot announces ({_between(factor, 1, 1)})"
        for name, factor in posterior.noise.items()
    )
    console.print(f"Noise: {factors}.")
    if posterior.effective is not None:
        console.print(
            f"PyBullet simulated {posterior.simulated} of {posterior.samples} samples; reweighted, "
            f"they are worth {posterior.effective:.1f}."
        )
    console.print(
        f"{result.interactions} interactions, {result.simulations_requested:,} simulations "
        f"requested, {result.simulations_run:,} run, {result.wall_seconds:.0f} s."
    )
    for warning in result.warnings:
        console.print(Text.assemble(("Warning:", "yellow"), f" {warning}"))


def _print_attachments(console: Console, posterior: PosteriorSummary) -> None:
    if not posterior.attachments:
        return
    sure = (
        "is not known: too few samples stand for it"
        if posterior.probability is None
        else f"is {_percent(posterior.probability)}"
    )
    console.print(f"The probability of these attachments together {sure}.")
    table = plain_table("what", "best body", "probability", justify="left")
    for item in posterior.attachments:
        table.add_row(item.what, item.value, _percent(item.probability))
    console.print(table)


def _print_rivals(console: Console, posterior: PosteriorSummary) -> None:
    for rival in posterior.rivals:
        what = "Cannot be told apart" if rival.alike else "Rival"
        console.print(Text(f"{what} ({_percent(rival.probability)}): {'; '.join(rival.differs)}."))


def _print_steps(console: Console, posterior: PosteriorSummary) -> None:
    table = plain_table(
        "interaction", "expected (bits)", "gained (bits)", "sure", "why", justify="left"
    )
    for number, step in enumerate(posterior.steps, 1):
        bits = (
            "–" if one is None else f"{one:.1f}" for one in (step.expected_bits, step.gained_bits)
        )
        table.add_row(str(number), *bits, _percent(step.probability), Text(step.reason))
    console.print(table)


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share < 0.9995 else "> 99.9 %"


def _mm(length: float) -> str:
    return f"{1000 * length:.1f}"


def _between(interval: Interval, factor: float, digits: int = 1) -> str:
    return f"{factor * interval.low:.{digits}f}–{factor * interval.high:.{digits}f}"
