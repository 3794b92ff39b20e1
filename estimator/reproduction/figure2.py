"""Figure 2: two parametric runs, one with all sensors and one without clearance."""

from __future__ import annotations

from pathlib import Path

from estimator.report.canvas import new_figure
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
from estimator.reproduction.paper_runs import Budget, typical_runs

NAME = "fig2"
PANELS = (("a", "b"), ("c", "d"))
CAPTION = (
    "Two runs of parametric identification. a: the subjective error of every model; touch, tilt "
    "and clearance count. b: the leg lengths of the best model of each generation of that run "
    "(dots: the robot's; arrows: which leg). c, d: the same of a run in which only touch and tilt "
    "count. Dotted vertical lines: an iteration ends, and a new pose comes in."
)


def make(root: Path, budget: Budget) -> DrawnFigure:
    """Draws the figure and writes its files."""
    finished = list(read_finished(root, typical_runs(budget)))
    if len(finished) < len(PANELS):
        return DrawnFigure.missing(NAME, CAPTION, "A run is missing.")
    picture = new_figure(11, 7.4)
    axes = picture.subplots(2, 2)
    rows: list[Row] = []
    for row, (run, panels) in enumerate(zip(finished, PANELS, strict=True)):
        run.draw_history(*axes[row])
        for panel, panel_axes in zip(panels, axes[row], strict=True):
            modalities = ", ".join(run.planned.variant.modalities)
            panel_axes.set_title(f"{panel}   {modalities}", loc="left", fontsize="medium", pad=22)
        rows += history_rows(run, panels)
    numbers = {
        "caption": CAPTION,
        "runs": {
            "".join(panels): history_numbers(run)
            for run, panels in zip(finished, PANELS, strict=True)
        },
    }
    write_figure(root, NAME, picture, header=HISTORY, rows=rows, numbers=numbers)
    return DrawnFigure(
        name=NAME, caption=CAPTION, sentences=tuple(_sentence(run) for run in finished)
    )


def _sentence(run: FinishedRun) -> str:
    last = run.generations[-1]
    errors = (run.best_lengths(last) - run.true_lengths) * 1000
    legs = ", ".join(
        f"{joint} {error:+.0f}" for joint, error in zip(run.score.joints, errors, strict=True)
    )
    return (
        f"With {', '.join(run.planned.variant.modalities)} (seed {run.planned.seed}) the last best "
        f"model has a subjective error of {number(run.result.sensor_error)}; its legs are "
        f"wrong by {legs} mm."
    )
