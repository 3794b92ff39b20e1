"""The page of a run: all that ``show`` prints, and bodies that can be turned and posed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from estimator.identification.method import information_in_words
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation
from estimator.report.camera import body_picture
from estimator.report.canvas import as_png, as_svg, leg_colour
from estimator.report.evaluations import read_true_body, read_validation, score_of, shown_errors
from estimator.report.outcome import WHAT_TO_CHECK, headline, worst_length
from estimator.report.page.templates import render
from estimator.report.plots import RunPlot, plot_predictions, run_plots
from estimator.report.result import Result
from estimator.report.shown_bodies import ShownBodies, shown_bodies
from estimator.report.tables import (
    as_stated_in_words,
    percent,
    probability_after,
    probability_sentence,
    sum_of_lengths,
)
from estimator.storage.run_config import RunSettings
from estimator.storage.store import RunStore
from protocol.text import command_line

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PICTURE = "The bodies in the pose of the last interaction: {}."


def run_page(
    store: RunStore, result: Result, without_truth: Sequence[RunPlot] | None = None
) -> tuple[str, bytes | None]:
    """Returns the page of a run as HTML, and the picture in it: a PNG, ``None`` without bodies.

    Args:
        store: The run.
        result: The run in numbers, as ``summarise`` returns it.
        without_truth: Plots of the run without true lengths, if they are drawn already; a run that
            was scored gets plots with these lengths instead.
    """
    posterior, legs = result.posterior, [leg.joint for leg in result.legs]
    score, validation = score_of(store.directory, result), read_validation(store.directory)
    seen, driven = store.observations(), sorted(store.problem.motors.driven)
    shown = shown_bodies(store, result, read_true_body(store.directory) if score else None)
    picture = as_png(body_picture(shown.bodies, legs)) if shown.bodies else None
    plots = without_truth
    if score or plots is None:
        plots = run_plots(store, legs, score.true_lengths_m if score else ())
    drawings = {plot.name: _drawing(plot.figure, plot.caption) for plot in plots}
    if shown.predicted:
        drawings["predictions"] = _drawing(
            plot_predictions(seen, shown.predicted),
            "Tilt and clearance in each interaction, as measured and as predicted; the table above "
            "has the numbers.",
        )
    html = render(
        "run.html",
        result=result,
        posterior=posterior,
        score=score,
        validation=shown_errors(validation) if validation else [],
        error_headings=[modality.heading for modality in MODALITIES.values()],
        headline=headline(result),
        **_verdict(result),
        interactions_asked=store.settings.interactions,
        facts=_facts(result),
        data=_data(store, shown, seen),
        samples=len(shown.bodies[0].samples) if shown.bodies else 0,
        flat=picture,
        flat_caption=_PICTURE.format("; ".join(f"{b.title}, {b.note}" for b in shown.bodies)),
        probability_sentence="" if posterior is None else probability_sentence(posterior),
        sums=[] if posterior is None else [sum_of_lengths(result, one) for one in posterior.sums],
        as_stated="" if posterior is None else as_stated_in_words(result, posterior),
        searched_attachments=any(not name.startswith("length") for name in result.searched),
        percent=percent,
        information_in_words=information_in_words,
        probability_after=probability_after,
        legs=list(zip(result.legs, result.leg_intervals, strict=True)),
        modalities=tuple(MODALITIES),
        readings=_readings(result, seen, shown.predicted, driven),
        plots=drawings,
        commands=commands(store.settings, store.directory, len(seen)),
        problem_text=store.settings.problem_text,
    )
    return html, picture


def _drawing(figure: Figure, caption: str) -> dict[str, str | Markup]:
    return {"caption": caption, "svg": Markup(as_svg(figure))}  # matplotlib escapes its text


def _verdict(result: Result) -> dict[str, Any]:
    """Template values that say whether any body fits: yes, no, or not known yet."""
    judged = result.judged
    if judged is not None:
        advice = () if judged.explained else WHAT_TO_CHECK
        return {"fits": judged.explained, "verdict": judged.verdict, "advice": advice}
    reason = "Nothing was learnt yet."
    if result.best_models:
        reason = "The best model of a population is judged when the search has ended."
    return {"fits": None, "verdict": reason, "advice": ()}


def _facts(result: Result) -> list[tuple[str, str]]:
    posterior = result.posterior
    facts = []
    if posterior is not None and posterior.attachments:
        stated = "not known" if posterior.probability is None else percent(posterior.probability)
        facts.append(("probability of the attachments", stated))
    if posterior is not None and posterior.lengths_m:
        facts.append(("lengths known to", f"± {worst_length(posterior):.1f} mm"))
    elif result.sensor_error is not None:
        facts.append(("subjective error", f"{result.sensor_error:.3f}"))
    facts.append(("movements", str(result.interactions)))
    facts.append(("simulations", f"{result.simulations_run:,}"))
    facts.append(("time", f"{result.wall_seconds:.0f} s"))
    return facts


def _readings(
    result: Result,
    seen: Sequence[Observation],
    predicted: Sequence[Observation | None],
    driven: Sequence[int],
) -> list[dict[str, Any]]:
    predictions = () if result.posterior is None else result.posterior.predicted
    judged = result.judged
    unexplained = set() if judged is None else {one.interaction for one in judged.unexplained}
    rows = []
    for index, observation in enumerate(seen):
        readings = predicted[index] if index < len(predicted) else None
        prediction = predictions[index] if index < len(predictions) else None
        rows.append(
            {
                "number": index + 1,
                "angles": _degrees(observation, driven),
                "cells": [
                    {
                        "measured": modality.say(observation),
                        "predicted": "no prediction"
                        if readings is None
                        else modality.say(readings),
                        "residual": prediction and prediction.residuals.get(name),
                    }
                    for name, modality in MODALITIES.items()
                ],
                "outlier": prediction and prediction.outlier_probability,
                "unexplained": index in unexplained,
            }
        )
    return rows


def _data(store: RunStore, shown: ShownBodies, seen: Sequence[Observation]) -> dict[str, Any]:
    """Data that the page's script draws."""
    driven = sorted(store.problem.motors.driven)
    return {
        "joints": [
            {
                "name": joint.name,
                "driven": index in driven,
                "low": round(math.degrees(max(joint.lower, -math.pi)), 1),
                "high": round(math.degrees(min(joint.upper, math.pi)), 1),
            }
            for index, joint in enumerate(store.capabilities.joints)
        ],
        "colours": [leg_colour(leg) for leg in range(len(driven))],
        "poses": [
            {
                "label": str(number),
                "angles": item.angles,
                "says": f"Interaction {number}: {_degrees(item, driven)}. Each body is turned as "
                "it would come to rest, the true one as it did; the heading is not measured.",
            }
            for number, item in enumerate(seen, 1)
        ],
        "bodies": [
            {
                "title": body.title,
                "note": body.note,
                "links": [link.model_dump() for link in body.links],
                "samples": [[link.model_dump() for link in sample] for sample in body.samples],
                "stands": body.stands,
            }
            for body in shown.bodies
        ],
    }


def _degrees(item: Observation, driven: Sequence[int]) -> str:
    angles = (round(math.degrees(item.angles[motor])) for motor in driven)
    return ", ".join(f"{angle:+d}°".replace("-", "−") for angle in angles)


def commands(settings: RunSettings, directory: Path, recorded: int) -> tuple[str, str]:
    """Command lines that make a run again: with its robot, and from its recorded readings.

    Args:
        settings: Settings of the run.
        directory: The run directory.
        recorded: Number of interactions that the run has had so far.
    """
    replay = settings.model_copy(update={"interactions": recorded})
    return (
        command_line("estimator", "identify", "--robot", settings.robot, *_options(settings)),
        command_line("estimator", "identify", "--robot", f"replay:{directory}", *_options(replay)),
    )


def _options(settings: RunSettings) -> Iterator[str]:
    yield from ("--problem", settings.problem, "--method", settings.method)
    yield from ("--interactions", str(settings.interactions), "--seed", str(settings.seed))
    yield from ("--modalities", ",".join(settings.modalities))
    yield from ("--physics", settings.physics, "--explore", settings.explore)
    if settings.sure is not None:
        yield from ("--sure", str(settings.sure))
    if settings.keeps_samples:
        if settings.learn != RunSettings.model_fields["learn"].default:
            yield from ("--learn", settings.learn)
    else:
        yield from ("--search", settings.search, "--objective", settings.objective)
        yield from ("--population", str(settings.population))
        yield from ("--generations", str(settings.generations))
        if settings.full_steps:
            yield "--full-steps"
