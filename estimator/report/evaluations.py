"""Score and validation of a run: files in the run directory, and tables in a terminal.

Only reports read the files (``validation.json``, ``score.json``, ``truth.urdf``); the search never
does. A file that is missing, damaged or of another version counts as none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.text import Text

from estimator.errors import TruthError
from estimator.evaluation.attachments import Configuration
from estimator.evaluation.score import Score
from estimator.evaluation.truth.urdf import Urdf, read_urdf
from estimator.evaluation.validate import Validation
from estimator.readings.modalities import MODALITIES, Quantity
from estimator.report.result import Result, in_words, read_document
from estimator.report.tables import mm, number, plain_table

SCORE: Final = "score.json"
TRUTH: Final = "truth.urdf"
VALIDATION: Final = "validation.json"

_MAX_WRONG: Final = 0.2  # largest share of programs (near forks) that a right body mispredicts
_NOT_IDENTIFIABLE: Final = Text("not identifiable", style="dim")
_FORK_MARGIN: Final = 0.2  # degrees of path margin; docs/accuracy.md shows what happens below


def score_of(directory: Path, result: Result) -> Score | None:
    """Score of a run; ``None`` where there is none, or the run has gone on since."""
    score, lengths = read_document(directory / SCORE, Score), [leg.length_m for leg in result.legs]
    return score if score and score.is_of(result.complete, lengths) else None


def read_validation(directory: Path) -> Validation | None:
    """Prediction errors of a run; ``None`` where there are none."""
    return read_document(directory / VALIDATION, Validation)


def read_true_body(directory: Path) -> Urdf | None:
    """The body that a run was scored against; ``None`` where it cannot be read."""
    try:
        return read_urdf(directory / TRUTH)
    except (OSError, TruthError):
        return None


def print_score(console: Console, score: Score) -> None:
    """Prints the best model beside the true body."""
    if not score.complete:
        console.print(
            Text.assemble(
                ("Warning:", "yellow"), " The run is not finished: the best model so far."
            )
        )
    table = plain_table("leg", "true (mm)", "estimated (mm)", "error (mm)", "touched")
    for row in zip(
        score.joints,
        map(mm, score.true_lengths_m),
        map(mm, score.lengths_m),
        (f"{error * 1000:+.1f}" for error in score.leg_errors_signed_m),
        map(in_words, score.touched),
        strict=True,
    ):
        table.add_row(*row)
    console.print(table)
    by_touch = "; ".join(
        f"legs that {condition} {mm(error)} mm"
        for condition, error in (
            ("touched the ground", score.mean_leg_error_touched_m),
            ("never did", score.mean_leg_error_never_touched_m),
        )
        if error is not None
    )
    console.print(
        f"Mean leg error {mm(score.mean_leg_error_m)} mm (signed "
        f"{score.mean_signed_leg_error_m * 1000:+.1f} mm){by_touch and '; '}{by_touch}."
    )
    console.print(_errors_of_truth(score.true_body_errors, score.true_body_margins_deg))
    _print_configurations(console, score)
    for sentence in score.not_representable:
        console.print(Text.assemble(("Not representable:", "yellow"), f" {sentence}."))


def _errors_of_truth(errors: Sequence[float | None], margins: Sequence[float]) -> str:
    """Sentence: how badly the true body fits; if worse than the best model, no search finds it."""
    comparable = [math.inf if error is None else error for error in errors]
    worst = max(range(len(comparable)), key=comparable.__getitem__)
    other_errors = comparable[:worst] + comparable[worst + 1 :]
    others_clause = f", at most {max(other_errors):.2f} in the others" if other_errors else ""
    forks = [str(number) for number, margin in enumerate(margins, 1) if margin < _FORK_MARGIN]
    forks_clause = (
        f" On ground inclined by {_FORK_MARGIN:g}° it would land elsewhere in interaction "
        f"{', '.join(forks)}: there a trifle decides, for the robot as well."
        if forks
        else ""
    )
    return (
        f"The true body, simulated, has a subjective error of {comparable[worst]:.2f} in "
        f"interaction {worst + 1}{others_clause}.{forks_clause}"
    )


def _print_configurations(console: Console, score: Score) -> None:
    """Prints how many attachments are right and, if the problem left any open, each part's."""
    given_note = "" if score.configurations_informative else " (given by the problem, not searched)"
    console.print(
        f"Configurations right: {score.configurations_right} of {score.configurations_total}"
        f"{given_note}, {score.configurations_right_up_to_equivalence} up to equivalence."
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
    parts = dict.fromkeys(cell.part for cell in score.configurations)
    for part in parts:
        cells = {cell.trait: cell for cell in score.configurations if cell.part == part}
        table.add_row(
            part,
            *(
                _marked(cells[trait]) if trait in cells else _NOT_IDENTIFIABLE
                for trait in ("parent", "mount", "hinge")
            ),
        )
    console.print(table)


def _marked(cell: Configuration) -> Text:
    if cell.right:
        return Text.assemble(("■", "green"), f" {cell.modelled}")
    mark = ("≈", "yellow") if cell.right_up_to_equivalence else ("□", "red")
    return Text.assemble(mark, f" {cell.modelled} ", (f"(true: {cell.true})", "dim"))


def shown_errors(validation: Validation) -> list[tuple[str, list[float | None]]]:
    """Errors of each group of models by modality, in the units that people are shown."""
    return [
        (name, [modality.shown(errors[modality.error_name]) for modality in MODALITIES.values()])
        for name, errors in validation.groups
    ]


def print_validation(console: Console, validation: Validation) -> None:
    """Prints whether the best model predicts the robot, and its errors beside other models'."""
    right, wrong = validation.as_predicted, validation.programs - validation.as_predicted
    *most, last = (one.say_limit() for one in MODALITIES.values() if isinstance(one, Quantity))
    limits = f"{', '.join(most)} and {last}"
    summary = f"{right} of {validation.programs} read as predicted, to {limits}"
    if wrong <= _MAX_WRONG * validation.programs:
        verdict, style = f"This body predicts the robot: {summary}.", "bold green"
    elif right >= wrong:
        verdict, style = f"This body predicts the robot in part: {summary}.", "bold yellow"
    else:
        verdict, style = f"This body does not predict the robot: {summary}.", "bold red"
    if 0 < wrong <= right:
        verdict += " Where a body stands near a fork, a trifle decides how it falls."
    console.print(Text(verdict, style=style))
    table = plain_table("models", *(modality.heading for modality in MODALITIES.values()))
    for name, errors in shown_errors(validation):
        table.add_row(name, *map(number, errors))
    console.print(f"Prediction error on {validation.programs} fresh motor programs:")
    console.print(table)
    if validation.invalid_predictions:
        console.print(f"{validation.invalid_predictions} predictions were invalid and left out.")
