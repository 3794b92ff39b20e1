"""What a run says first: whether the body is found, how surely, what it is, what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

from rich.console import Console
from rich.table import Table
from rich.text import Text

from estimator.identification.record_link import is_record
from estimator.report.posterior_report import PosteriorReport
from estimator.report.result import MAIN_BODY, LegResult, ModelResult, Result
from estimator.report.tables import (
    between,
    mm,
    number,
    percent,
    plain_table,
    print_details,
    sum_of_lengths,
)
from estimator.storage.posteriors import SURE
from protocol.text import command_line

WHAT_TO_CHECK: Final = (
    "Does the problem describe this robot? Thickness and shape of parts, units, where legs sit.",
    "Do the servos stand in the problem's order, each turning its way? robotd try shows it.",
    "Has each tilt its sign, and each foot its own gauge? robotd try shows it.",
    "Does every servo reach and hold its angle? robotd doctor --move shows it.",
    "Is the ground level and firm?",
)
"""What to check where no body explains the readings, the likeliest first."""

_Step: TypeAlias = tuple[tuple[object, ...], str]
"""The words of a command after ``estimator``, and what it does."""

_LIKELY: Final = 0.5


def headline(result: Result) -> str:
    """Whether the body is found and how surely, in a few words."""
    legs = _subject(result)
    judged, posterior = result.judged, result.posterior
    if not result.legs:
        return "Nothing is known of this body yet"
    if judged is None or not judged.explained:
        return f"{legs}, not judged yet" if judged is None else "Not found: no body explains it all"
    if posterior is None:
        return f"{legs}: a model that explains the readings; how surely, nobody knows"
    if posterior.at_ends:
        parts = " and ".join(name for length in posterior.at_ends for name in length.parts)
        return f"{legs}, not found yet: the problem's range ends where the length of {parts} does"
    if not posterior.attachments:
        return f"{legs}, {_how_well(posterior)}"
    return f"{legs}, {_how_sure(posterior.probability)}"


def _how_well(posterior: PosteriorReport) -> str:
    """How well lengths are known where nothing else is to be found."""
    if posterior.low_ess:
        return "but how well they are known rests on few samples"
    accuracy = f"to ± {worst_length(posterior):.0f} mm"
    if not posterior.knows_cause(SURE):
        return f"{accuracy}; whether the robot is as the problem says is not known yet"
    if posterior.stated(1.0) < SURE:
        return f"probably {accuracy}: {percent(posterior.stated(1.0))} probable"
    return f"found {accuracy}"


def _may_have_something_else(posterior: PosteriorReport) -> bool:
    """Whether all is sure, except that the named cause may only read like the real one."""
    has_cause = posterior.causes and posterior.causes[0].probability >= SURE
    within_problem = posterior.probability_within_problem or 0.0
    return bool(has_cause) and within_problem >= SURE > posterior.stated(1.0)


def _subject(result: Result) -> str:
    """Number of legs in words, or of parts where some sit on others: a leg may be several parts."""
    parts = result.best_models[0].parts if result.best_models else ()
    if any(part.joint and part.parent != MAIN_BODY for part in parts):
        return f"{len(parts)} parts"
    return f"{len(result.legs)} {'leg' if len(result.legs) == 1 else 'legs'}"


def _how_sure(probability: float | None) -> str:
    if probability is None:
        return "but how sure they are is not known"
    if probability >= SURE:
        return f"found: {percent(probability)} sure"
    likely = "probably these" if probability >= _LIKELY else "not found yet"
    return f"{likely}: {percent(probability)} probable"


def worst_length(posterior: PosteriorReport) -> float:
    """Half of the widest 90 % interval of a length, mm."""
    return max((500 * length.width for length in posterior.lengths_m), default=0.0)


def print_result(
    console: Console, result: Result, directory: Path | None = None, *, details: bool = False
) -> None:
    """Prints the outcome of a run.

    Args:
        console: Where to print.
        result: The outcome.
        directory: The run directory, for the commands that are proposed next.
        details: Whether to print everything else that is known, too.
    """
    judged = result.judged
    is_explained = judged is not None and judged.explained
    style = "bold green" if is_explained else "bold red" if judged is not None else "bold"
    state = "" if result.complete else "Not finished. "
    console.print(Text(f"{state}{headline(result)}.", style=style))
    if judged is not None:
        console.print(Text(judged.verdict))
    for change in () if result.posterior is None else result.posterior.changes:
        console.print(Text(f"Changed since it was identified: {change}.", style="bold"))
    for table in _body(result):
        console.print(table)
    posterior = result.posterior
    for known_sum in () if posterior is None else posterior.sums:
        console.print(Text(sum_of_lengths(result, known_sum)))
    if result.best_models and posterior is None:
        console.print(
            f"Sensor (subjective) error of the best model: {number(result.sensor_error, 3)}. A "
            "population that has converged agrees, right or wrong: how uncertain a length is, only "
            "--method posterior says."
        )
    for warning in result.warnings:
        console.print(Text.assemble(("Warning:", "yellow"), f" {warning}"))
    for line in next_steps(result, directory):
        console.print(Text(line), soft_wrap=True)
    if details:
        print_details(console, result)


def _body(result: Result) -> Iterator[Table]:
    """Tables of how the parts are attached and how long the legs are; one where parts are legs."""
    if not result.legs:
        return
    model = result.best_models[0] if result.best_models else None
    by_joint = {leg.joint: leg for leg in result.legs}
    open_parts = any(not name.startswith("length") for name in result.searched)
    if model is not None and open_parts:
        are_legs = len(model.parts) == len(by_joint) == len({part.joint for part in model.parts})
        yield _parts(result, model, by_joint if are_legs else {})
        if are_legs:
            return
    heading = "in the population (mm)" if result.posterior is None else "90 % interval (mm)"
    table = plain_table("leg", "mount", "length (mm)", heading, "touched")
    for leg, length in zip(result.legs, result.leg_intervals, strict=True):
        cells = mm(length.median), between(length, 1000), leg.touched_in_words
        table.add_row(leg.joint, leg.mount, *cells)
    yield table


def _parts(result: Result, model: ModelResult, legs: dict[str, LegResult]) -> Table:
    has_posterior = result.posterior is not None
    sure = ["sure"] if has_posterior else []
    table = plain_table("part", "sits on", "mount", "hinge", *sure, justify="left")
    lengths = dict(zip(legs, result.leg_intervals, strict=True)) if legs else {}
    add_numbers = partial(table.add_column, justify="right", no_wrap=True)
    add_numbers("length (mm)" if legs else "best body (mm)")
    if legs:
        add_numbers("90 % interval" if has_posterior else "in the population")
        table.add_column("touched", overflow="fold")
    for part in model.parts:
        row = [part.name, part.parent, part.mount, part.hinge if part.joint else "–"]
        if has_posterior:
            row.append("–" if part.agreement is None else percent(part.agreement))
        if part.joint in lengths:
            length = lengths[part.joint]
            row += [mm(length.median), between(length, 1000), legs[part.joint].touched_in_words]
        else:
            row.append(mm(part.length_m))
        table.add_row(*row)
    return table


def next_steps(result: Result, directory: Path | None) -> list[str]:
    """What to do now, line by line."""
    judged, checks = result.judged, list[str]()
    if judged is not None and not judged.explained:
        checks.append("Check, the likeliest first:")
        checks += [f"  {place}. {check}" for place, check in enumerate(WHAT_TO_CHECK, 1)]
    if directory is not None and not result.complete:
        return [*checks, "Next:", *_commands([(("resume", directory), "goes on")])]
    if checks or directory is None or not result.legs:
        return checks
    robot, posterior = result.robot_uri, result.posterior
    lines: list[str] = ["Next:"]
    movements: list[_Step] = []
    if posterior is not None and _may_have_something_else(posterior):
        lines += [
            "  Measure what the robot seems to have otherwise, say it in the problem (its value,",
            "  or under [uncertain]), and identify it anew: more movements make this no surer.",
        ]
    elif posterior is not None and not (
        (posterior.probability or 0.0) >= SURE
        and posterior.knows_cause(SURE)
        and not posterior.at_ends
    ):
        problem, interactions = result.problem_asked or result.problem, result.interactions + 3
        asked = ("--problem", problem, "--interactions", interactions)
        again = ("identify", "--robot", robot, *asked)
        anew = "anew, with the range widened if the length may lie beyond it"
        movements.append((again, anew if posterior.at_ends else "more movements make it surer"))
    else:
        validate = ("validate", directory, "--robot", robot)
        movements.append((validate, "predicts fresh movements, then makes them"))
    pose = ("pose", directory, "--robot", robot, "--highest")
    movements.append((pose, "a pose by what it knows"))
    files: list[_Step] = [
        (("export", directory, "--format", "urdf"), "the body as a file for simulators"),
        (("show", directory, "--details"), "probabilities, rivals, each movement"),
    ]
    steps = files if is_record(robot) else [*movements, *files]
    return [*lines, *_commands(steps)]


def _commands(steps: Sequence[_Step]) -> list[str]:
    return [f"  {command_line('estimator', *words)}    {what}" for words, what in steps]
