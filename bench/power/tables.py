"""Results of the study's runs, as tables and as a plot."""

from __future__ import annotations

import importlib
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.power.built import BUILT
from bench.power.study import FAULTY, KNOWN_ATTACHMENTS, SUBJECTS
from bench.power.trial import Figures, Step, Trial, TrialRun
from estimator.report.canvas import COLOURS, new_figure
from estimator.reproduction.paper_claims import share
from estimator.reproduction.tables import markdown, write_csv
from estimator.storage.posteriors import SURE

Runs = Sequence[tuple[Trial, Sequence[Figures]]]
Steps = Sequence[tuple[Figures, Step]]
"""Runs after one interaction."""

LIKELY: Final = 0.5
"""Probability that something is otherwise, from which on a verdict says what it is."""

_BINS: Final = (0.0, 0.5, 0.8, SURE, 0.99, 1.0 + 1e-9)


def by_group(runs: Iterable[TrialRun], root: Path) -> dict[str, list[tuple[Trial, list[Figures]]]]:
    """The figures of finished runs, by group and trial."""
    groups: dict[str, dict[str, tuple[Trial, list[Figures]]]] = {}
    for run in runs:
        trials = groups.setdefault(run.group, {})
        trials.setdefault(run.trial.name, (run.trial, []))[1].append(run.figures(root))
    return {group: list(trials.values()) for group, trials in groups.items()}


def overview(done: Mapping[str, Runs], made: str) -> str:
    """Tables of each group, and of whether statements come true, in Markdown.

    Args:
        done: Runs by group.
        made: Sentence that names the commits which made the runs.
    """
    parts = [f"{made}\n"]
    for group, runs in done.items():
        parts.append(f"\n## {group.capitalize()}\n\n{SUBJECTS.get(group, '')}\n\n")
        if group == BUILT:
            table = markdown(BUILT_SUMMARY, built_summary(runs))
        elif group in FAULTY:
            table = markdown(FAULTS, fault_rows(runs))
        else:
            table = markdown(SUMMARY, summary_rows(runs))
        parts.append(f"{table}\n")
    sound = {
        group: [run for _, figures in runs for run in figures]
        for group, runs in done.items()
        if group not in FAULTY and group != BUILT
    }
    parts.append(_calibration(sound))
    return "".join(parts)


def write_tables(done: Mapping[str, Runs], folder: Path, made: str) -> None:
    """Writes ``summary.csv``, with results after each interaction, and files with each run.

    Args:
        done: Runs by group.
        folder: Folder for the files.
        made: Sentence that names the commits, written into each line.
    """
    built = {group: runs for group, runs in done.items() if group == BUILT}
    faulty = {group: runs for group, runs in done.items() if group in FAULTY}
    sound = {group: runs for group, runs in done.items() if group not in {*built, *faulty}}
    for name, header, groups, rows in (
        ("summary", SUMMARY, sound, summary_rows),
        ("runs", RUNS, sound, run_rows),
        ("faults", FAULTS, faulty, fault_rows),
        ("built", BUILT_RUNS, built, built_rows),
    ):
        lines = ((group, *row, made) for group, runs in groups.items() for row in rows(runs))
        write_csv(folder / f"{name}.csv", ("group", *header, "commit"), lines)


SUMMARY: Final = (
    *("trial", "after interaction", "all right", "95 % interval", "stated >= 0.95"),
    *("of these right", "mean leg error (mm)", "median leg error (mm)"),
    *("legs in their 90 % interval", "CPU (s)"),
)
RUNS: Final = (
    *("trial", "seed", "right after", "stated after each interaction", "leg errors (mm)"),
    *("CPU (s)", "no body explains it"),
)
FAULTS: Final = (
    *("robot", "seed", "attachments right", "stated", "leg errors (mm)"),
    *("certain and wrong", "what it says"),
)


BUILT_SUMMARY: Final = (
    *("robot", "all right", "owned", "stated >= 0.95", "of these right", "certain and wrong"),
    *("legs in their 90 % interval", "half-width (mm)", "named", "amount", "CPU (s)"),
)
BUILT_RUNS: Final = (
    *("robot", "seed", "attachments right", "stated", "owned", "leg errors (mm)", "inside"),
    *("half-widths (mm)", "half-widths as stated (mm)", "causes", "named", "amount"),
    *("certain and wrong", "CPU (s)", "what it says"),
)


def summary_rows(runs: Runs) -> Iterator[tuple[str, ...]]:
    """A row for each trial after each interaction: bodies right, their probabilities, lengths."""
    for trial, figures in runs:
        for number, steps in enumerate(by_interaction(figures), start=1):
            yield trial.name, str(number), *_success(steps)


def by_interaction(figures: Sequence[Figures]) -> Iterator[Steps]:
    """Runs after each interaction, those that went so far."""
    for at in range(max((len(run.steps) for run in figures), default=0)):
        yield [(run, run.steps[at]) for run in figures if at < len(run.steps)]


def share_right(steps: Steps) -> tuple[float, float, float]:
    """Share of runs in which all attachments are right, and its 95 % interval (Wilson's)."""
    right = share(sum(step.cells == run.cells for run, step in steps), len(steps))
    return right.successes / right.trials, right.low, right.high


def _success(steps: Steps) -> tuple[str, ...]:
    right = [step.cells == run.cells for run, step in steps]
    _, low, high = share_right(steps)
    sure = [
        is_right
        for is_right, (_, step) in zip(right, steps, strict=True)
        if step.explained and (step.probability or 0.0) >= SURE
    ]
    states = any(step.probability is not None for _, step in steps)
    errors = np.abs([error for _, step in steps for error in step.leg_errors_mm])
    inside = [held for _, step in steps for held in step.inside]
    return (
        f"{sum(right)} of {len(right)}",
        f"{100 * low:.0f}–{100 * high:.0f} %",
        str(len(sure)) if states else "–",
        str(sum(sure)) if states else "–",
        f"{errors.mean():.1f}",
        f"{np.median(errors):.1f}",
        f"{sum(inside)} of {len(inside)}" if inside else "–",
        f"{np.mean([step.cpu_seconds for _, step in steps]):.0f}",
    )


def run_rows(runs: Runs) -> Iterator[tuple[str, ...]]:
    """A row for each run; in parentheses: stated of a body that does not explain the readings."""
    for trial, figures in runs:
        for run in figures:
            marks = "".join("■" if step.cells == run.cells else "□" for step in run.steps)
            stated = ", ".join(
                "–"
                if step.probability is None
                else f"{step.probability:.2f}"
                if step.explained
                else f"({step.probability:.2f})"
                for step in run.steps
            )
            errors = " ".join(f"{error:+.1f}" for error in _last_errors(run))
            verdict = "" if run.explained else run.verdict
            cpu = f"{run.cpu_seconds:.0f}"
            yield trial.name, str(run.seed), marks, stated, errors, cpu, verdict


def fault_rows(runs: Runs) -> Iterator[tuple[str, ...]]:
    """A row for each run with a fault: what it says, and whether it is certain and wrong."""
    for trial, figures in runs:
        for run in figures:
            last = run.steps[-1] if run.steps else None
            cells = f"{last.cells} of {run.cells}" if last else "–"
            stated = f"{last.probability:.2f}" if last and last.probability is not None else "–"
            errors = " ".join(f"{error:+.0f}" for error in _last_errors(run))
            wrong = "yes" if run.certain_and_wrong else "no"
            yield trial.name, str(run.seed), cells, stated, errors, wrong, run.verdict


def built_summary(runs: Runs) -> Iterator[tuple[str, ...]]:
    """A row for each kind of robot that is built otherwise than its problem says."""
    for trial, figures in runs:
        lasts = [run.steps[-1] for run in figures if run.steps]
        sure = [run.right for run in figures if run.certain]
        inside = [held for last in lasts for held in last.inside]
        built = [width / 2 for last in lasts for width in last.widths_mm]
        stated = [width / 2 for last in lasts for width in last.stated_widths_mm]
        yield (
            trial.name,
            f"{sum(run.right for run in figures)} of {len(figures)}",
            str(sum(run.explained for run in figures)),
            str(len(sure)),
            str(sum(sure)),
            str(sum(run.certain_and_wrong for run in figures)),
            f"{sum(inside)} of {len(inside)}",
            f"{_mean(built)}; {_mean(stated)}",
            _share(_is_named(trial, last) for last in lasts),
            _share(_holds_amount(trial, last) for last in lasts),
            f"{np.mean([run.cpu_seconds for run in figures]):.0f}",
        )


def built_rows(runs: Runs) -> Iterator[tuple[str, ...]]:
    """A row for every robot that is built otherwise than its problem says."""
    for trial, figures in runs:
        for run in figures:
            if not run.steps:
                yield trial.name, str(run.seed), *["–"] * (len(BUILT_RUNS) - 3), run.verdict
                continue
            last = run.steps[-1]
            yield (
                trial.name,
                str(run.seed),
                f"{last.cells} of {run.cells}",
                "–" if last.probability is None else f"{last.probability:.3f}",
                "yes" if run.explained else "no",
                " ".join(f"{error:+.1f}" for error in last.leg_errors_mm),
                f"{sum(last.inside)} of {len(last.inside)}",
                " ".join(f"{width / 2:.1f}" for width in last.widths_mm),
                " ".join(f"{width / 2:.1f}" for width in last.stated_widths_mm),
                "; ".join(f"{name} {share:.2f}" for name, share in last.causes),
                _yes(_is_named(trial, last)),
                _yes(_holds_amount(trial, last)),
                "yes" if run.certain_and_wrong else "no",
                f"{run.cpu_seconds:.0f}",
                run.verdict,
            )


def _is_named(trial: Trial, last: Step) -> bool | None:
    """Whether what is otherwise is among the first two causes named; ``None``: not asked."""
    true = trial.robot.otherwise
    if true is None or not true.cause or true.narrow:
        return None
    named = [
        name for name, _ in last.causes[:2] if sum(share for _, share in last.causes) >= LIKELY
    ]
    return any(name.startswith(true.cause) for name in named)


def _holds_amount(trial: Trial, last: Step) -> bool | None:
    """Whether the interval of what is otherwise holds the true amount; ``None``: not asked."""
    true = trial.robot.otherwise
    if true is None or true.amount is None:
        return None
    low, high = last.amounts.get(true.cause, (0.0, 0.0))
    return low <= true.amount <= high


def _yes(answer: bool | None) -> str:
    return "–" if answer is None else "yes" if answer else "no"


def _share(answers: Iterable[bool | None]) -> str:
    answered = [answer for answer in answers if answer is not None]
    return f"{sum(answered)} of {len(answered)}" if answered else "–"


def _mean(values: Sequence[float]) -> str:
    return f"{np.mean(values):.1f}" if values else "–"


def _calibration(done: Mapping[str, Sequence[Figures]]) -> str:
    """Whether statements come true as often as they say, over all steps of all runs."""
    steps = [
        (step.probability, step.cells == run.cells)
        for group, figures in done.items()
        if group != KNOWN_ATTACHMENTS
        for run in figures
        for step in run.steps
        if step.probability is not None and step.explained
    ]
    lines = [
        "\n## Do statements come true?\n",
        "All interactions of all runs above where attachments were open, but for the faults, and "
        "for those after\nwhich a run said that no body explains the readings: what is stated "
        "there stands in parentheses.\n",
        markdown(("stated", "how often", "mean statement", "came true"), _bins(steps)),
    ]
    figures = itertools.chain.from_iterable(done.values())
    inside = [held for run in figures for step in run.steps[-1:] for held in step.inside]
    if inside:
        lines.append(
            f"\nOf the 90 % intervals at the end of runs {sum(inside)} of {len(inside)} hold the "
            "true length."
        )
    return "\n".join(lines) + "\n"


def _bins(steps: Sequence[tuple[float, bool]]) -> Iterator[tuple[str, ...]]:
    for low, high in itertools.pairwise(_BINS):
        chosen = [(stated, true) for stated, true in steps if low <= stated < high]
        if chosen:
            mean = np.mean([stated for stated, _ in chosen])
            true = sum(true for _, true in chosen)
            yield f"{low:g}–{min(high, 1):g}", str(len(chosen)), f"{mean:.2f}", str(true)


def _last_errors(one: Figures) -> tuple[float, ...]:
    return one.steps[-1].leg_errors_mm if one.steps else ()


if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARKERS: Final = "os^Dvp"
_SHADE: Final = 0.15  # opacity of the 95 % interval


def plot_success(runs: Runs) -> Figure:
    """Plots the share of runs with all attachments right, with its 95 % interval (Wilson).

    Args:
        runs: Runs of a group; each trial is a line.
    """
    figure = new_figure(8.4, 3.6)
    by_movement, by_seconds = figure.subplots(1, 2, sharey=True)
    for (trial, figures), colour, marker in zip(
        runs, itertools.cycle(COLOURS), itertools.cycle(_MARKERS)
    ):
        interactions = list(by_interaction(figures))
        shares = np.array([share_right(steps) for steps in interactions])
        seconds = [np.mean([step.cpu_seconds for _, step in steps]) for steps in interactions]
        for axes, places in ((by_movement, range(1, len(interactions) + 1)), (by_seconds, seconds)):
            axes.plot(
                places, shares[:, 0], color=colour, marker=marker, linewidth=1.1, label=trial.name
            )
            axes.fill_between(
                places, shares[:, 1], shares[:, 2], color=colour, alpha=_SHADE, linewidth=0
            )
    ticker = importlib.import_module("matplotlib.ticker")
    by_movement.yaxis.set_major_formatter(ticker.PercentFormatter(1.0))
    by_movement.xaxis.set_major_locator(ticker.MaxNLocator(integer=True))
    by_movement.set(xlabel="movements", ylabel="all attachments right", ylim=(0, 1.02))
    by_seconds.set(xlabel="CPU of the estimator (s), in the mean", xscale="log")
    by_seconds.xaxis.set_major_formatter(ticker.FormatStrFormatter("%g"))
    handles, names = by_movement.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper right", ncols=3, frameon=False)
    return figure
