"""Results as a person reads them in a terminal: millimetres, degrees, plain warnings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from rich.console import Console
from rich.text import Text

from estimator.evaluation.attachments import Configuration
from estimator.evaluation.score import Score
from estimator.evaluation.validate import Validation
from estimator.readings.modalities import MODALITIES
from estimator.report.result import ModelFound, Result, in_words
from estimator.report.tables.plain import plain_table
from estimator.report.tables.posterior import print_posterior
from estimator.report.tables.verdict import print_verdict

_NOT_FELT: Final = Text("not felt", style="dim")
_FORK: Final = 0.2  # degrees of path margin; docs/reproduction.md shows what happens below


def print_result(console: Console, result: Result) -> None:
    """A run's outcome: what it cost, the body, and what to be wary of."""
    if result.posterior is not None:
        print_posterior(console, result, result.posterior)
        return
    if result.fit is not None:
        print_verdict(console, result.fit)
    state = "complete" if result.complete else "not finished"
    console.print(
        Text.assemble(
            *("Problem ", (result.problem, "bold"), f", seed {result.seed}, "),
            f"{', '.join(result.modalities)}; {result.physics}; {state}.",
        )
    )
    uncounted = f"{result.simulations_invalid:,} of them invalid"
    if result.simulations_undecided:
        uncounted += f", {result.simulations_undecided:,} undecided"
    console.print(
        f"{result.interactions} interactions, {result.simulations_requested:,} simulations "
        f"requested, {result.simulations_run:,} run ({uncounted}), {result.wall_seconds:.0f} s."
    )
    if result.best_models:
        error = number(result.sensor_error, 3)
        console.print(f"Sensor (subjective) error of the best model: {error}.")
    if result.finish is not None and result.best_models:
        end, best = result.finish, result.best_models[0]
        console.print(
            f"{result.reference} had the last word on {end.models} leading models: of "
            f"{end.pairs} pairs it orders {end.pairs_turned} otherwise than "
            f"{result.physics}, and it {'prefers another' if end.best_changed else 'keeps the'} "
            f"best model (whose error is {number(best.sensor_error, 3)}, "
            f"{number(best.searched_error, 3)} by {result.physics})."
        )
    if result.legs:
        table = plain_table("leg", "mount", "length (mm)", "in the population (mm)", "touched")
        for leg in result.legs:
            table.add_row(
                leg.joint,
                leg.mount,
                _mm(leg.length_m),
                "–" if leg.population_m is None else "–".join(map(_mm, leg.population_m)),
                leg.touched_in_words,
            )
        console.print(table)
        console.print(
            "Models that have converged are alike, right or wrong: how sure a length is, only "
            "--method posterior says."
        )
    if result.best_models and any(not name.startswith("length") for name in result.searched):
        _print_parts(console, result.best_models[0])
    for warning in result.warnings:
        console.print(Text.assemble(("Warning:", "yellow"), f" {warning}"))


def _print_parts(console: Console, model: ModelFound) -> None:
    """How the best model's parts hang together."""
    table = plain_table("part", "sits on", "mount", "positive angle", "length (mm)")
    for part in model.parts:
        table.add_row(
            part.name,
            part.parent,
            part.mount,
            part.hinge if part.joint else _NOT_FELT,
            _mm(part.length_m),
        )
    console.print(table)


def print_score(console: Console, score: Score) -> None:
    """The best model against the truth."""
    if not score.complete:
        console.print(
            Text.assemble(
                ("Warning:", "yellow"), " The run is not finished: the best model so far."
            )
        )
    table = plain_table("leg", "true (mm)", "estimated (mm)", "error (mm)", "touched")
    for row in zip(
        score.joints,
        map(_mm, score.true_lengths_m),
        map(_mm, score.lengths_m),
        (f"{error * 1000:+.1f}" for error in score.leg_errors_signed_m),
        map(in_words, score.touched),
        strict=True,
    ):
        table.add_row(*row)
    console.print(table)
    apart = "; ".join(
        f"legs that {what} {_mm(error)} mm"
        for what, error in (
            ("touched the ground", score.mean_leg_error_touched_m),
            ("never did", score.mean_leg_error_never_touched_m),
        )
        if error is not None
    )
    console.print(
        f"Mean leg error {_mm(score.mean_leg_error_m)} mm (signed "
        f"{score.mean_signed_leg_error_m * 1000:+.1f} mm){apart and '; '}{apart}."
    )
    console.print(_true_body(score.true_body_errors, score.true_body_margins_deg))
    _print_configurations(console, score)
    for sentence in score.not_representable:
        console.print(Text.assemble(("Not representable:", "yellow"), f" {sentence}."))


def _true_body(errors: Sequence[float | None], margins: Sequence[float]) -> str:
    """How badly the truth fits: where worse than the best model, nothing could have found it."""
    known = [math.inf if error is None else error for error in errors]
    worst = max(range(len(known)), key=known.__getitem__)
    others = known[:worst] + known[worst + 1 :]
    rest = f", at most {max(others):.2f} in the others" if others else ""
    forks = [str(number) for number, margin in enumerate(margins, 1) if margin < _FORK]
    where = (
        f" On ground inclined by {_FORK:g}° it would land elsewhere in interaction "
        f"{', '.join(forks)}: there a trifle decides, for the robot as well."
        if forks
        else ""
    )
    return (
        f"The true body, simulated, has a subjective error of {known[worst]:.2f} in interaction "
        f"{worst + 1}{rest}.{where}"
    )


def _print_configurations(console: Console, score: Score) -> None:
    """What of the attachments is right; each part's, where the problem left any to be found."""
    known = "" if score.configurations_informative else " (given by the problem, not searched)"
    console.print(
        f"Configurations right: {score.configurations_right} of {score.configurations_total}"
        f"{known}, {score.configurations_right_up_to_equivalence} up to equivalence."
    )
    if not score.configurations_informative:
        return
    console.print(
        f"Of the {score.configurations_informative} that might have been wrong: "
        f"{score.configurations_informative_right} right, "
        f"{score.configurations_informative_right_up_to_equivalence} up to equivalence. By chance "
        f"{score.configurations_chance:.2f} of {score.configurations_total} would be."
    )
    table = plain_table("part", "P: sits on", "O: mount", "J: positive angle", justify="left")
    parts = dict.fromkeys(item.part for item in score.configurations)
    for part in parts:
        cells = {item.trait: item for item in score.configurations if item.part == part}
        table.add_row(
            part,
            *(
                _verdict(cells[trait]) if trait in cells else _NOT_FELT
                for trait in ("parent", "mount", "hinge")
            ),
        )
    console.print(table)


def _verdict(cell: Configuration) -> Text:
    if cell.right:
        return Text.assemble(("■", "green"), f" {cell.modelled}")
    mark = ("≈", "yellow") if cell.right_up_to_equivalence else ("□", "red")
    return Text.assemble(mark, f" {cell.modelled} ", (f"(true: {cell.true})", "dim"))


def print_validation(console: Console, validation: Validation) -> None:
    """Prediction errors beside those of models that know nothing."""
    table = plain_table("models", *(modality.heading for modality in MODALITIES.values()))
    for name, errors in validation.groups:
        shown = (modality.shown(errors[modality.error_name]) for modality in MODALITIES.values())
        table.add_row(name, *map(number, shown))
    console.print(f"Prediction error on {validation.programs} fresh motor programs:")
    console.print(table)
    if validation.invalid_predictions:
        console.print(f"{validation.invalid_predictions} predictions were invalid and left out.")


def number(value: float | None, digits: int = 2) -> str:
    """A number, or a dash where there is none."""
    return "–" if value is None else f"{value:.{digits}f}"


def _mm(length: float | None) -> str:
    return "–" if length is None else f"{length * 1000:.1f}"
