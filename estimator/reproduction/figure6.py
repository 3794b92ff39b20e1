"""Figure 6: how many configurations the best model of each topological run has right."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from estimator.readings.modalities import MODALITIES
from estimator.report.canvas import new_figure
from estimator.reproduction.figure import DrawnFigure, FinishedRun, Row, read_finished, write_figure
from estimator.reproduction.paper_claims import Share, share
from estimator.reproduction.paper_runs import TOPOLOGICAL, TOPOLOGICAL_8X4, Budget, topological_runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PROBLEMS: Final = {"fig6": TOPOLOGICAL, "fig6-8x4": TOPOLOGICAL_8X4}
_RUNS: Final = {
    "fig6": "The topological runs; a configuration is P, O or J of one of four legs.",
    "fig6-8x4": (
        "The topological runs with the genome of the paper's text, 8×4; a configuration is P or O "
        "of one of eight parts, or J of one of the four that are driven."
    ),
}
_CAPTION: Final = (
    "Each column: how many local configurations the best model has right (black: right; white: "
    "wrong); the best is the one with the lowest subjective error. Hatched: wrong, but no sensor "
    "of the run could tell. Dashed line: what a model drawn at random has right on average."
)
HEADER: Final = (
    *("seed", "right", "right_up_to_equivalence", "of", "informative_right", "informative"),
    *("subjective_error", "true_bodys_subjective_error", "mean_leg_error_m"),
    *("touch_error", "tilt_error_deg", "clearance_error_mm"),
)


def make(
    root: Path, budget: Budget, runs: int | None, name: str
) -> tuple[DrawnFigure, Share | None]:
    """Draws ``fig6`` or ``fig6-8x4`` and writes its files; returns it and the successful share."""
    caption = f"{_RUNS[name]} {_CAPTION}"
    finished = list(read_finished(root, topological_runs(runs, budget, _PROBLEMS[name])))
    if not finished:
        return DrawnFigure.missing(name, caption), None
    total = finished[0].score.configurations_total
    informative = finished[0].score.configurations_informative
    chance = finished[0].score.configurations_chance
    successes = share(sum(run.successful for run in finished), len(finished))
    picture = new_figure(max(6.0, 0.42 * len(finished) + 2.5), 5)
    _draw(picture.subplots(), finished, chance)
    equivalent = sum(
        run.score.configurations_right_up_to_equivalence == run.score.configurations_total
        for run in finished
    )
    hidden = sum(map(_is_hidden, finished))
    numbers: dict[str, Any] = {
        "caption": caption,
        "seeds": [run.planned.seed for run in finished],
        "right": [run.score.configurations_right for run in finished],
        "right_up_to_equivalence": [
            run.score.configurations_right_up_to_equivalence for run in finished
        ],
        "configurations": total,
        "informative_configurations": informative,
        "by_chance": chance,
        "successes": successes.successes,
        "successes_up_to_equivalence": equivalent,
        "runs": successes.trials,
        "wilson_95": [successes.low, successes.high],
        "truth_fits_worse_than_the_best_model": hidden,
    }
    write_figure(
        root,
        name,
        picture,
        header=HEADER,
        rows=[_row(run) for run in finished],
        numbers=numbers,
    )
    sentences = (
        f"{successes.successes} of {successes.trials} runs found all {total} configurations "
        f"(95 % interval {successes.low:.0%} to {successes.high:.0%}), {equivalent} of "
        f"{successes.trials} up to equivalence; the paper: 1 of 10, all of its 12.",
        f"By chance {chance:.2f} of {total} would be right. "
        f"{total - informative} of the {total} cannot be wrong: the "
        "first part has nothing to sit on but the main body.",
        f"In {hidden} of {successes.trials} runs the true body, had it been a model, fits worse "
        "than the best one that was found. Where by much, its simulation comes to rest otherwise "
        "in some interaction than the robot did, and the search is led away from it.",
    )
    return DrawnFigure(name=name, caption=caption, sentences=sentences), successes


def _is_hidden(run: FinishedRun) -> bool:
    """Whether the true body fits worse than the best model."""
    truth, best = run.score.true_body_error, run.result.sensor_error
    return best is not None and (truth is None or truth > best)


def _draw(axes: Axes, finished: Sequence[FinishedRun], chance: float) -> None:
    total = max(run.score.configurations_total for run in finished)
    for column, run in enumerate(finished):
        right = run.score.configurations_right
        equivalent = run.score.configurations_right_up_to_equivalence
        for cell in range(run.score.configurations_total):
            axes.bar(
                column,
                1,
                0.8,
                bottom=cell,
                color="black" if cell < right else "white",
                edgecolor="0.4",
                linewidth=0.6,
                hatch="////" if right <= cell < equivalent else None,
            )
    axes.axhline(
        chance,
        color="#d55e00",
        linestyle="--",
        linewidth=1.6,
        label=f"a model drawn at random: {chance:.2f} of {total}",
    )
    axes.set_xticks(range(len(finished)), [str(run.planned.seed) for run in finished], rotation=90)
    axes.set_xlim(-0.6, len(finished) - 0.4)
    axes.set_yticks(range(0, total + 1, 2))
    axes.set_ylim(0, total)
    axes.set_xlabel("run (seed)")
    axes.set_ylabel("configurations right")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
    axes.spines[["top", "right"]].set_visible(False)


def _row(run: FinishedRun) -> Row:
    score, errors = run.score, run.validation and run.validation.best_model
    return (
        run.planned.seed,
        score.configurations_right,
        score.configurations_right_up_to_equivalence,
        score.configurations_total,
        score.configurations_informative_right,
        score.configurations_informative,
        run.result.sensor_error,
        score.true_body_error,
        score.mean_leg_error_m,
        *(errors and errors[modality.error_name] for modality in MODALITIES.values()),
    )
