"""Plots of a run: errors over generations, probability and intervals over interactions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from estimator.body.limbs import driven_limbs
from estimator.body.morphology import Array
from estimator.posterior.fitted import FittedPosterior
from estimator.problem.genome import Genome
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation
from estimator.report.canvas import (
    COLOURS,
    leg_colour,
    leg_label,
    leg_markers,
    new_axes,
    new_figure,
)
from estimator.report.posterior_report import length_intervals
from estimator.storage.posteriors import PosteriorSummary
from estimator.storage.records import Generation
from estimator.storage.store import RunStore

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ABOVE: Final[dict[str, Any]] = {
    **{"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.1},
    **{"frameon": False, "fontsize": "small", "columnspacing": 1.0, "handlelength": 1.4},
}
"""Options that put a legend above its panel, where it hides nothing."""


def draw_errors(axes: Axes, generations: Sequence[Generation]) -> None:
    """Draws every model's subjective error over generations, and a line where an iteration ends."""
    label(axes, "subjective error of each model")
    for generation in generations:
        errors = np.array(generation.errors)
        errors = errors[np.isfinite(errors)]
        axes.plot(
            np.full(len(errors), generation.number),
            errors,
            ".",
            color="0.55",
            markersize=2.5,
            rasterized=True,  # tens of thousands of dots would make a drawing of lines too large
        )
    best = [min(generation.errors) for generation in generations]
    axes.plot(range(len(best)), best, "-", color=leg_colour(0), linewidth=1.2, label="best model")
    axes.set_yscale("log" if min(best) > 0 else "linear")  # an objective may well reach 0
    axes.legend(**ABOVE)
    mark_iterations(axes, generations)


def draw_lengths(
    axes: Axes,
    generations: Sequence[Generation],
    genome: Genome,
    names: Sequence[str],
    *,
    targets: Sequence[float] = (),
    mounts: Sequence[str] = (),
) -> None:
    """Draws the best model's leg lengths over generations.

    Args:
        axes: The panel to draw in.
        generations: The run's generations.
        genome: Genome that decodes their best models.
        names: Names of the legs' joints.
        targets: True length of each leg, m, drawn as dots at the right, where they are known.
        mounts: Mount of each leg, which decides its arrow; default: its mount on the last best
            model. Of several legs on a mount the first has the arrow.
    """
    label(axes, "leg length of the best model (cm)")
    bodies = genome.decode_all(np.array([generation.best for generation in generations]))
    numbers = [generation.number for generation in generations]
    legs = list(zip(*map(driven_limbs, bodies), strict=True))
    markers = leg_markers(mounts or [limbs[-1].mount for limbs in legs])
    for leg, (name, limbs) in enumerate(zip(names, legs, strict=True)):
        colour = leg_colour(leg)
        axes.plot(
            numbers,
            [limb.length * 100 for limb in limbs],
            marker=markers[leg],
            markevery=max(1, len(numbers) // 60),
            color=colour,
            markersize=4.5,
            linewidth=0.8,
            label=leg_label(name),
        )
    _draw_targets(axes, numbers[-1] + 1.5, targets)
    if names:
        legend_of_names(axes, columns=min(5, len(names) + bool(targets)))
    mark_iterations(axes, generations)


def _draw_targets(axes: Axes, place: float, targets: Sequence[float]) -> None:
    """Draws the true length of each leg, m, where they are known, and ends the panel at 0."""
    for leg, target in enumerate(targets):
        axes.plot(place, target * 100, "o", color=leg_colour(leg), markersize=6)
    if targets:
        axes.plot([], [], "o", color="0.3", label="true length")
    axes.set_ylim(bottom=0)


def label(axes: Axes, quantity: str) -> None:
    """Names the axes of a panel over generations."""
    axes.set_xlabel("generation")
    axes.set_ylabel(quantity)
    axes.spines[["top", "right"]].set_visible(False)


def legend_of_names(axes: Axes, *, columns: int) -> None:
    """Draws a legend above a panel, its names not read as formulas: they may hold dollar signs."""
    for text in axes.legend(ncols=columns, **ABOVE).get_texts():
        text.set_parse_math(False)


def mark_iterations(axes: Axes, generations: Sequence[Generation]) -> None:
    """Draws a vertical line where an iteration ends and a new interaction comes in."""
    last = {generation.iteration: generation.number for generation in generations}
    for number in last.values():
        axes.axvline(number + 0.5, color="0.2", linewidth=0.7, linestyle=":")


_MARK_DISTANCE: Final = 0.08  # distance between the legs' marks, in interactions


def plot_interval_lengths(
    history: Sequence[FittedPosterior],
    names: Sequence[str],
    targets: Sequence[float] = (),
) -> Figure:
    """Plots median and 90 % interval of each leg's length after each interaction.

    Args:
        history: The posterior after each interaction.
        names: Names of the legs' joints.
        targets: True length of each leg, m, where they are known.
    """
    figure, axes = new_axes()
    label(axes, "leg length (cm), 90 % interval")
    axes.set_xlabel("interaction")
    intervals = [length_intervals(fitted.leg_lengths, fitted.weights) for fitted in history]
    last_body = history[-1].best_body
    assert last_body is not None
    markers = leg_markers([limb.mount for limb in driven_limbs(last_body)])
    for leg, name in enumerate(names):
        low, median, high = (
            100 * np.array([(one[leg].low, one[leg].median, one[leg].high) for one in intervals]).T
        )
        colour = leg_colour(leg)
        positions = np.arange(1, len(history) + 1) + _MARK_DISTANCE * (leg - (len(names) - 1) / 2)
        axes.errorbar(
            positions,
            median,
            yerr=[median - low, high - median],
            linestyle="none",
            marker=markers[leg],
            color=colour,
            markersize=4.5,
            elinewidth=1.0,
            label=leg_label(name),
        )
    _draw_targets(axes, len(history) + 0.7, targets)
    axes.set_xticks(range(1, len(history) + 1))
    if names:
        legend_of_names(axes, columns=min(5, len(names) + bool(targets)))
    return figure


def plot_probability(
    summaries: Sequence[PosteriorSummary], expected: Sequence[float | None]
) -> Figure:
    """Plots the attachments' probability after each interaction, and the information it gave.

    Args:
        summaries: What is stated of the posterior after each interaction.
        expected: Information that each interaction was expected to give, bits, where it was known.
    """
    figure, axes = new_axes()
    label(axes, "stated probability of the attachments")
    axes.set_xlabel("interaction")
    numbers = np.arange(1, len(summaries) + 1)
    axes.plot(
        numbers,
        [np.nan if summary.probability is None else summary.probability for summary in summaries],
        "o-",
        color=leg_colour(0),
        label="probability",
    )
    axes.set_ylim(0, 1.02)
    axes.set_xticks(numbers)
    twin = axes.twinx()
    twin.set_ylabel("information (bits)")
    twin.spines["top"].set_visible(False)
    expectation = [np.nan if gain is None else gain for gain in expected]
    gained = [
        np.nan if summary.information_gain_bits is None else summary.information_gain_bits
        for summary in summaries
    ]
    twin.bar(
        numbers - 0.15, expectation, width=0.28, color=leg_colour(5), alpha=0.5, label="expected"
    )
    twin.bar(numbers + 0.15, gained, width=0.28, color=leg_colour(2), alpha=0.5, label="gained")
    handles, labels = axes.get_legend_handles_labels()
    bar_handles, bar_labels = twin.get_legend_handles_labels()
    axes.legend(handles + bar_handles, labels + bar_labels, ncols=3, **ABOVE)
    return figure


_PANEL_LABELS: Final = ("tilt left/right (°)", "tilt forward/back (°)", "clearance (mm)")


def plot_predictions(
    measured: Sequence[Observation], predicted: Sequence[Observation | None]
) -> Figure:
    """Plots tilt and clearance in each interaction; what is missing is left out.

    Args:
        measured: Readings of the robot.
        predicted: Readings that the best body predicts; ``None`` where its simulation is invalid.
    """
    figure = new_figure(9.0, 3.2)
    numbers = np.arange(1, len(predicted) + 1)
    robot, body = (
        np.array([_numbers(observation) for observation in readings])
        for readings in (measured[: len(predicted)], predicted)
    )
    panels = figure.subplots(1, len(_PANEL_LABELS))
    for column, (axes, quantity) in enumerate(zip(panels, _PANEL_LABELS, strict=True)):
        axes.set_xlabel("interaction")
        axes.set_ylabel(quantity)
        axes.set_xticks(numbers)
        axes.spines[["top", "right"]].set_visible(False)
        axes.plot(
            numbers, robot[:, column], "o", color="0.25", markerfacecolor="none", label="measured"
        )
        axes.plot(numbers, body[:, column], "x", color=COLOURS[0], label="predicted")
    panels[-1].legend(ncols=2, **ABOVE)
    return figure


def _numbers(item: Observation | None) -> Array:
    if item is None:
        return np.full(3, np.nan)
    shown = (MODALITIES[name] for name in ("tilt", "clearance"))
    return np.concatenate([modality.error_factor * modality.observed(item) for modality in shown])


LENGTHS: Final = "lengths"


@dataclass(frozen=True, kw_only=True)
class RunPlot:
    """One plot of a run.

    Attributes:
        name: Stem of the plot's file name.
        caption: What the plot shows, also for readers who cannot see it.
        figure: The plot.
    """

    name: str
    caption: str
    figure: Figure


def run_plots(
    store: RunStore, names: Sequence[str], true_lengths: Sequence[float] = ()
) -> tuple[RunPlot, ...]:
    """Draws the plots of a run so far; none where nothing was learnt yet.

    Args:
        store: The run.
        names: Names of the legs' joints.
        true_lengths: True length of each leg, m, where they are known.
    """
    truth_note = "; dots at the right: the true lengths" if true_lengths else ""
    history = FittedPosterior.history(store)
    if history:
        summaries = [fitted.summary for fitted in history if fitted.summary is not None]
        expected = [item.bits for item in store.interactions()][: len(summaries)]
        return (
            RunPlot(
                name="probability",
                caption="Stated probability of the attachments after each interaction, and the "
                "information that it was expected to give and gave.",
                figure=plot_probability(summaries, expected),
            ),
            RunPlot(
                name=LENGTHS,
                caption="Length of each leg after each interaction: median and 90 % interval"
                f"{truth_note}.",
                figure=plot_interval_lengths(history, names, true_lengths),
            ),
        )
    generations = with_last_word(store)
    if not generations:
        return ()
    (errors, errors_axes), (lengths, lengths_axes) = new_axes(), new_axes()
    draw_errors(errors_axes, generations)
    draw_lengths(lengths_axes, generations, store.genome, names, targets=true_lengths)
    return (
        RunPlot(
            name="errors",
            caption="Subjective error of every model over generations, and of the best one; dotted "
            "lines where a new interaction comes in.",
            figure=errors,
        ),
        RunPlot(
            name=LENGTHS,
            caption=f"Length of each leg of the best model over generations{truth_note}.",
            figure=lengths,
        ),
    )


def with_last_word(store: RunStore) -> list[Generation]:
    """A run's generations, with the reference back-end's errors as one more if it was asked.

    The best model of the last generation is the best of the run, with the error that all tables
    give it.
    """
    generations = store.generations()
    finish, fitted = store.search_end.finish(), FittedPosterior.of(store)
    if finish is None or not finish.models or fitted is None or fitted.best is None:
        return generations
    last = generations[-1]
    last_word = replace(
        last,
        number=last.number + 1,
        iteration=last.iteration + 1,
        errors=finish.simulated,
        best=tuple(fitted.best.tolist()),
    )
    return [*generations, last_word]
