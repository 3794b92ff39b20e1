"""Words and tables of a run, in millimetres and degrees, and its details in a terminal."""

from __future__ import annotations

from rich.console import Console, JustifyMethod
from rich.table import Table
from rich.text import Text

from estimator.identification.method import information_in_words
from estimator.readings.modalities import MODALITIES
from estimator.report.posterior_report import (
    PosteriorReport,
    Step,
    SumOfLengths,
)
from estimator.report.result import Result
from estimator.report.verdict import program_in_words
from estimator.storage.posteriors import Interval


def plain_table(*columns: str, justify: JustifyMethod = "right") -> Table:
    """A table without lines; headings are bold, long words fold, the first column is flush left."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index == 0 else justify, overflow="fold")
    return table


def print_details(console: Console, result: Result) -> None:
    """Prints probabilities, rivals, each movement, how each reading fits, and what the run cost."""
    posterior = result.posterior
    console.print(
        Text.assemble(
            *("Problem ", (result.problem, "bold"), f", seed {result.seed}, "),
            f"{', '.join(result.modalities)}; {'posterior by ' if posterior else ''}"
            f"{result.physics}.",
        )
    )
    if posterior is None:
        _print_search(console, result)
    else:
        _print_posterior(console, result, posterior)


def _print_posterior(console: Console, result: Result, posterior: PosteriorReport) -> None:
    if posterior.attachments:
        console.print(probability_sentence(posterior))
        table = plain_table("what", "best body", "share of samples", justify="left")
        for attachment in posterior.attachments:
            table.add_row(attachment.what, attachment.value, percent(attachment.probability))
        console.print(table)
    _print_otherwise(console, result, posterior)
    _print_rivals(console, result, posterior)
    _print_steps(console, posterior)
    _print_residuals(console, posterior)
    factors = "; ".join(
        f"{name} {factor.median:.1f} times what is expected ({between(factor, 1, 1)})"
        for name, factor in posterior.noise.items()
    )
    if factors:
        console.print(f"Noise: {factors}.")
    if posterior.ess is not None:
        console.print(
            f"{result.reference} simulated {posterior.simulated} of {posterior.samples} samples; "
            f"their effective sample size is {posterior.ess:.1f}, and sets of attachments are "
            "weighed by them."
        )
    console.print(
        f"{result.interactions} interactions, {result.simulations_requested:,} simulations "
        f"requested, {result.simulations_run:,} run, {result.wall_seconds:.0f} s."
    )


def as_stated_in_words(result: Result, posterior: PosteriorReport) -> str:
    """A sentence: the lengths if the robot is just as stated; empty without ``as_stated_m``."""
    if not posterior.as_stated_m:
        return ""
    listed = ", ".join(
        f"{leg.joint} {mm(length.median)} ± {mm(length.width / 2)}"
        for leg, length in zip(result.legs, posterior.as_stated_m, strict=True)
    )
    attached = ""
    if posterior.attachments:
        share = percent(posterior.stated(posterior.probability_within_problem or 0.0))
        attached = f", and attached as the best body ({share})"
    return f"If the robot is exactly as stated{attached}: {listed} mm."


def _print_otherwise(console: Console, result: Result, posterior: PosteriorReport) -> None:
    stated = as_stated_in_words(result, posterior)
    if stated:
        console.print(Text(stated))
    if posterior.parameters:
        learnt = "; ".join(parameter.sentence for parameter in posterior.parameters)
        console.print(Text(f"What the readings say besides: {learnt}."))
    for cause in posterior.causes:
        console.print(
            Text(
                f"Otherwise ({percent(posterior.stated(cause.probability))}): {cause.sentence}. "
                f"{cause.check}."
            )
        )


def _print_rivals(console: Console, result: Result, posterior: PosteriorReport) -> None:
    for rival in posterior.rivals:
        label = "Indistinguishable" if rival.indistinguishable else "Rival"
        console.print(Text(f"{label} ({percent(rival.probability)}): {'; '.join(rival.differs)}."))
    if posterior.equivalent:
        console.print(Text(f"Not identifiable by any movement: {'; '.join(posterior.equivalent)}."))
    movement = posterior.next_movement
    if movement is not None:
        names = [joint["name"] for joint in result.robot["joints"]]
        angles = program_in_words(movement.program, names)
        information = information_in_words(movement.bits)
        gain = information if movement.bits else "it is expected to tell little"
        console.print(Text(f"Most informative next movement: {angles}; {movement.reason}; {gain}."))


def _print_steps(console: Console, posterior: PosteriorReport) -> None:
    table = plain_table(
        *("interaction", "expected (bits)", "gained (bits)", "probability", "why"), justify="left"
    )
    for place, step in enumerate(posterior.steps, 1):
        bits = (
            "–" if value is None else f"{value:.1f}"
            for value in (step.expected_gain_bits, step.information_gain_bits)
        )
        table.add_row(str(place), *bits, probability_after(step), Text(step.reason))
    console.print(table)
    console.print("A bit halves the possibilities.")


def _print_residuals(console: Console, posterior: PosteriorReport) -> None:
    console.print("Measured minus predicted by the best body, in standard deviations of the noise:")
    table = plain_table("interaction", *MODALITIES, "outlier")
    for number, prediction in enumerate(posterior.predicted, 1):
        residuals = (prediction.residuals.get(name) for name in MODALITIES)
        cells = ("–" if value is None else f"{value:+.1f}" for value in residuals)
        table.add_row(str(number), *cells, percent(prediction.outlier_probability))
    console.print(table)


def probability_after(step: Step) -> str:
    """Stated probability of the attachments after a movement, as text for a cell of a table."""
    stated = "not known" if step.probability is None else percent(step.probability)
    return stated if step.explained else f"{stated}, not explained"


def probability_sentence(posterior: PosteriorReport) -> str:
    """A sentence: how probable the best body's attachments are, and on what condition."""
    stated = (
        f"is not known: {posterior.not_known}"
        if posterior.probability is None
        else f"is {percent(posterior.probability)}"
    )
    premise = ""
    if posterior.misspecification_probability:
        premise = (
            "; the probability that the robot is otherwise than this problem can say, "
            f"{percent(posterior.misspecification_probability)}"
        )
    return f"The probability of these attachments together {stated}{premise}."


def sum_of_lengths(result: Result, known: SumOfLengths) -> str:
    """A sentence: two legs of whose lengths only the sum is known."""
    first, second = (result.legs[leg].joint for leg in known.legs)
    return (
        f"Of {first} and {second} the sum is known: {mm(known.length_m.median)} mm "
        f"({between(known.length_m, 1000)})."
    )


def percent(share: float) -> str:
    """A probability in per cent, as text."""
    return f"{100 * share:.1f} %" if share < 0.9995 else "> 99.9 %"


def between(interval: Interval, factor: float, digits: int = 1) -> str:
    """The ends of an interval, each times a factor, as text."""
    dash = "–" if interval.low >= 0 else " to "
    return f"{factor * interval.low:.{digits}f}{dash}{factor * interval.high:.{digits}f}"


def _print_search(console: Console, result: Result) -> None:
    """Prints what the search of the method ``paper`` did."""
    uncounted = f"{result.simulations_invalid:,} of them invalid"
    if result.simulations_undecided:
        uncounted += f", {result.simulations_undecided:,} undecided"
    console.print(
        f"{result.interactions} interactions, {result.simulations_requested:,} simulations "
        f"requested, {result.simulations_run:,} run ({uncounted}), {result.wall_seconds:.0f} s."
    )
    if result.finish is not None and result.best_models:
        finish, best = result.finish, result.best_models[0]
        console.print(
            f"{result.reference} had the last word on {finish.models} leading models: of "
            f"{finish.pairs} pairs it orders {finish.pairs_turned} otherwise than "
            f"{result.physics}, and it {'prefers another' if finish.best_changed else 'keeps the'} "
            f"best model (whose error is {number(best.sensor_error, 3)}, "
            f"{number(best.searched_error, 3)} by {result.physics})."
        )


def number(value: float | None, digits: int = 2) -> str:
    """A number, or a dash where there is none."""
    return "–" if value is None else f"{value:.{digits}f}"


def mm(length: float | None) -> str:
    """A length in millimetres, or a dash where there is none."""
    return "–" if length is None else f"{length * 1000:.1f}"
