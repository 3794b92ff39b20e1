"""Results as a person reads them in a terminal: millimetres, degrees, plain warnings."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from estimator.report.result import Result
from estimator.score import Score
from estimator.validate import Errors, Validation


def print_result(console: Console, result: Result) -> None:
    """A run's outcome: what it cost, the legs, and what to be wary of."""
    state = "complete" if result.complete else "not finished"
    console.print(
        f"Problem [bold]{result.problem}[/], seed {result.seed}, "
        f"{', '.join(result.modalities)}; {result.physics}; {state}."
    )
    console.print(
        f"{result.interactions} interactions, {result.simulations_requested} simulations "
        f"requested, {result.simulations_run} run, {result.wall_seconds:.0f} s."
    )
    if result.sensor_error is not None:
        console.print(f"Sensor (subjective) error of the best model: {result.sensor_error:.3f}.")
    if result.legs:
        table = _table("leg", "side", "length (mm)", "spread (mm)", "5–95 % (mm)", "touched")
        for leg in result.legs:
            low, high = leg.range_m
            table.add_row(
                leg.joint,
                leg.side,
                _mm(leg.length_m),
                _mm(leg.spread_m),
                f"{_mm(low)}–{_mm(high)}",
                _yes(leg.touched),
            )
        console.print(table)
    for warning in result.warnings:
        console.print(f"[yellow]Warning:[/] {warning}")


def print_score(console: Console, score: Score) -> None:
    """The best model against the truth."""
    table = _table("leg", "true (mm)", "estimated (mm)", "error (mm)", "touched")
    for row in zip(
        score.joints,
        map(_mm, score.true_lengths_m),
        map(_mm, score.lengths_m),
        (f"{error * 1000:+.1f}" for error in score.leg_errors_signed_m),
        map(_yes, score.touched),
        strict=True,
    ):
        table.add_row(*row)
    console.print(table)
    console.print(
        f"Mean leg error {_mm(score.mean_leg_error_m)} mm (signed "
        f"{score.mean_signed_leg_error_m * 1000:+.1f} mm); legs that touched the ground "
        f"{_mm(score.mean_leg_error_touched_m)} mm, legs that never did "
        f"{_mm(score.mean_leg_error_never_touched_m)} mm."
    )
    known = "" if score.configurations_searched else " (given by the problem, not searched)"
    console.print(
        f"Configurations right: {score.configurations_right} of {score.configurations_total}"
        f"{known}, {score.configurations_right_up_to_equivalence} up to equivalence."
    )
    for sentence in score.not_representable:
        console.print(f"[yellow]Not representable:[/] {sentence}.")


def print_validation(console: Console, validation: Validation) -> None:
    """Prediction errors beside those of models that know nothing."""
    table = _table("models", "touch wrong (%)", "tilt (°)", "clearance (mm)")
    groups: Sequence[tuple[str, Errors]] = (
        ("best model", validation.best_model),
        ("population, median", validation.population_median),
        ("random models, median", validation.random_models),
    )
    for name, errors in groups:
        touch = None if errors.touch is None else 100 * errors.touch
        table.add_row(name, *map(_number, (touch, errors.tilt_deg, errors.clearance_mm)))
    console.print(f"Prediction error on {validation.programs} fresh motor programs:")
    console.print(table)
    if validation.invalid_predictions:
        console.print(f"{validation.invalid_predictions} predictions were invalid and left out.")


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index == 0 else "right")
    return table


def _mm(length: float | None) -> str:
    return "–" if length is None else f"{length * 1000:.1f}"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _yes(value: bool | None) -> str:
    return "not sensed" if value is None else "yes" if value else "never"
