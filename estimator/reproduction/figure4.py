"""Figure 4: a successful topological run from its first generation to its last."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from estimator.report.canvas import new_figure
from estimator.report.plots import mark_iterations
from estimator.report.tables import number
from estimator.reproduction.figure import (
    HISTORY,
    DrawnFigure,
    FinishedRun,
    Row,
    history_numbers,
    history_rows,
    read_finished,
    write_figure,
)
from estimator.reproduction.paper_runs import Budget, PlannedRun, Summary, topological_runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAME: Final = "fig4"
CAPTION: Final = (
    "A topological run: the first by seed that found all configurations, or, where none did, that "
    "has most right. a: the subjective error of every model. b: the leg lengths of the best model "
    "of each generation (dots: the robot's; arrows: which leg). c: which local configurations the "
    "best model of each iteration has right (filled) or wrong (white): parent P, orientation O and "
    "joint J of each leg; beside it, the same for each generation. Dotted vertical lines: an "
    "iteration ends."
)
_LETTERS: Final = {"parent": "P", "mount": "O", "hinge": "J"}


def choose(root: Path, budget: Budget, runs: int | None) -> PlannedRun | None:
    """The first successful run by seed, or else the one with most configurations right."""
    scores = {run: Summary.read(run, root).score for run in topological_runs(runs, budget)}
    right = {run: score.configurations_right for run, score in scores.items() if score}
    return max(right, key=lambda run: right[run], default=None)  # the first of equals


def make(root: Path, budget: Budget, runs: int | None) -> DrawnFigure:
    """Draws the figure and writes its files."""
    chosen = choose(root, budget, runs)
    if chosen is None:
        return DrawnFigure.missing(NAME, CAPTION)
    (run,) = read_finished(root, [chosen])
    right = np.array([run.configurations_right(item) for item in run.generations])
    names = _names(run)
    picture = new_figure(12, 8)
    axes = picture.subplots(2, 2, height_ratios=(1, 1))
    run.draw_history(*axes[0])
    _draw_ends(axes[1, 0], run, right, names)
    _draw_generations(axes[1, 1], run, right, names)
    for panel, letter in zip(axes.flat, ("a", "b", "c", "c, each generation"), strict=True):
        panel.set_title(letter, loc="left")
    rows = [*history_rows(run, ("a", "b")), *_configuration_rows(run, right, names)]
    numbers = {
        "caption": CAPTION,
        "successful": run.successful,
        **history_numbers(run),
        "configurations": names,
        "right_at_iteration_ends": [right[item.number].tolist() for item in run.iteration_ends],
        "first_generation_with_all_right": _first_with_all(right),
    }
    write_figure(root, NAME, picture, header=HISTORY, rows=rows, numbers=numbers)
    return DrawnFigure(name=NAME, caption=CAPTION, sentences=_sentences(run, right))


def _names(run: FinishedRun) -> list[str]:
    return [f"{item.part} {_LETTERS[item.trait]}" for item in run.score.configurations]


def _draw_ends(axes: Axes, run: FinishedRun, right: Any, names: list[str]) -> None:
    for generation in run.iteration_ends:
        for row, correct in enumerate(right[generation.number]):
            axes.scatter(
                generation.iteration + 1,
                row,
                s=110,
                marker="s",
                facecolor="black" if correct else "white",
                edgecolor="black",
                linewidth=0.8,
            )
    axes.set_xticks([generation.iteration + 1 for generation in run.iteration_ends])
    axes.set_xlim(0.4, len(run.iteration_ends) + 0.6)
    axes.set_xlabel("iteration")
    _rows(axes, names)


def _draw_generations(axes: Axes, run: FinishedRun, right: Any, names: list[str]) -> None:
    axes.imshow(
        right.T,
        aspect="auto",
        interpolation="nearest",
        cmap="Greys",
        vmin=0,
        vmax=1,
        extent=(-0.5, len(right) - 0.5, len(names) - 0.5, -0.5),
    )
    mark_iterations(axes, run.generations)
    axes.set_xlabel("generation")
    _rows(axes, names)


def _rows(axes: Axes, names: list[str]) -> None:
    axes.set_yticks(range(len(names)), names, fontsize="small")
    axes.set_ylim(len(names) - 0.4, -0.6)
    legs = [name.rpartition(" ")[0] for name in names]
    for row in range(1, len(names)):
        if legs[row] != legs[row - 1]:
            axes.axhline(row - 0.5, color="0.7", linewidth=0.6)


def _configuration_rows(run: FinishedRun, right: Any, names: list[str]) -> list[Row]:
    return [
        ("c", item.number, item.iteration + 1, "configuration_right", name, int(correct))
        for item in run.generations
        for name, correct in zip(names, right[item.number], strict=True)
    ]


def _first_with_all(right: Any) -> int | None:
    complete = np.flatnonzero(np.all(right, axis=1))
    return int(complete[0]) if len(complete) else None


def _sentences(run: FinishedRun, right: Any) -> tuple[str, ...]:
    score, first = run.score, _first_with_all(right)
    total = score.configurations_total
    if run.successful and first is not None:
        generation = run.generations[first]
        opening = (
            f"Seed {run.planned.seed} is the first whose best model has all {total} configurations "
            f"right; it had them for the first time in iteration {generation.iteration + 1} (the "
            "paper's run: in the eighth)."
        )
    else:
        opening = (
            f"No run found all {total} configurations. Shown is seed {run.planned.seed}, the first "
            f"of those with most right, {score.configurations_right}."
        )
    fits = _fits(run)
    lengths = ", ".join(
        f"{length * 1000:.0f} ({true_length * 1000:.0f})"
        for length, true_length in zip(score.lengths_m, score.true_lengths_m, strict=True)
    )
    return opening, fits, f"Leg lengths of its last best model, and the robot's (mm): {lengths}."


def _fits(run: FinishedRun) -> str:
    """A sentence: how well the model explains the readings, beside the true body."""
    error, truth = run.result.sensor_error, run.score.true_body_error
    return (
        f"Its last best model has a subjective error of {number(error)}, where the true body, had "
        f"it been a model, has {number(truth)}."
    )
