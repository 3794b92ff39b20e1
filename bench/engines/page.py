"""The tables and plots of the comparison, for people and for docs/physics.md."""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bench.engines.figures import CLOSE, COVERED, Compared, differences, risk_coverage
from bench.engines.runs import CEILINGS, RIVALS, RUNS
from estimator.body.morphology import Array
from estimator.errors import EstimatorError
from estimator.report.canvas import COLOURS, new_figure
from estimator.reproduction.tables import markdown

_BEGIN: Final = "<!-- measured: begin (make compare-engines writes from here) -->"
_END: Final = "<!-- measured: end -->"


_DPI: Final = 110
_LEAST_ANGLE: Final = 1e-4  # degrees; smaller differences are drawn here
_CURVES: Final = ("fine", "inert", "coarse", "mujoco")
_SELF: Final = (("coarse", "fine"), ("inert", "fine"), ("mujoco", "fine"))


def tables(
    figures: Sequence[dict[str, Any]], causes: Sequence[dict[str, Any]], command: str
) -> str:
    """All tables, in Markdown.

    Args:
        figures: Figures of each problem.
        causes: Disagreements of all problems.
        command: Command that was run.
    """
    sizes = ", ".join(f"{item['bodies']} ({item['problem']})" for item in figures)
    rivals = [(RUNS[run].label, run) for run in RIVALS]
    ceilings = [(label, name) for name, _, _, label in CEILINGS]
    paragraphs = [
        f"`{command}`; random bodies, each with a random motor program: {sizes}.",
        "Share of valid, decided poses whose tilt statics and the engine agree on within 0.5°, "
        "with its 95 % interval:",
        _shares(figures, rivals, "statics_and", "within"),
        "The same among the 85 % of poses with the largest path margin (more, where margins tie):",
        _shares(figures, rivals, "statics_and", "within_where_sure"),
        "The ceiling: how far an engine agrees with itself, or another engine with it:",
        _shares(figures, ceilings, "ceilings", "within"),
        *_details(figures),
        *_causes(figures, causes),
    ]
    return "\n\n".join(paragraphs) + "\n"


def _shares(
    figures: Sequence[dict[str, Any]], pairs: Sequence[tuple[str, str]], kind: str, within: str
) -> str:
    """A table of shares: a row for each pair, given by its label and name, a column a problem."""
    rows = (
        (label, *(_interval(item[kind][name][within]) for item in figures)) for label, name in pairs
    )
    return markdown(("", *(item["problem"] for item in figures)), rows)


def _details(figures: Sequence[dict[str, Any]]) -> list[str]:
    header = (
        *("problem", "engine", "invalid", "moving", "median", "95 % of poses within"),
        *("clearance, median", "touch", "within 0.5°, those at rest"),
    )
    rows = (
        (
            item["problem"],
            RUNS[run].label,
            str(measured["invalid"]),
            str(measured["moving"]),
            f"{measured['median_deg']:.4f}°",
            f"{measured['quantile_95_deg']:.2f}°",
            f"{measured['median_clearance_mm']:.3f} mm",
            _percent(measured["touch_alike"]),
            _percent(measured["within_where_still"]["share"]),
        )
        for item in figures
        for run, measured in item["statics_and"].items()
    )
    undecided = (
        f"{item['problem']}: {item['undecided']} of {item['bodies']} poses are undecided; 85 % of "
        f"the others have a path margin above {item['margin_of_85_percent_deg']:.1f}°.  "
        for item in figures
    )
    return [
        "Statics and each engine in detail. *Moving*: the main body is faster than 1 mm/s at the "
        "end; *touch*: share of touch bits that are alike.",
        markdown(header, rows),
        "\n".join(undecided),
    ]


def _causes(figures: Sequence[dict[str, Any]], causes: Sequence[dict[str, Any]]) -> list[str]:
    problems = [item["problem"] for item in figures]
    counts = Counter((item["cause"], item["problem"]) for item in causes)
    totals = Counter(item["cause"] for item in causes)
    rows = [
        (name, *(str(counts[name, problem]) for problem in problems))
        for name, _ in totals.most_common()
    ]
    all_of = (str(sum(item["problem"] == problem for item in causes)) for problem in problems)
    suspects = [item for item in causes if item["suspect"]]
    paragraphs = [
        "Every pose on which statics and the reference (PyBullet at 1/240 s) differ by over 0.5°, "
        "by cause: what has to be changed in the simulation for the body to lie as statics says. "
        "Numbers of poses:",
        markdown(("", *problems), [*rows, ("**all**", *all_of)]),
        "Of these, poses of large path margin (among the 85 %) on which PyBullet at both steps and "
        f"MuJoCo agree with each other: {len(suspects)}.",
    ]
    if suspects:
        header = ("problem", "body", "statics (°)", "engines (°)", "margin (°)", "cause")
        paragraphs.append(markdown(header, map(_suspect, suspects)))
    return paragraphs


def _suspect(item: dict[str, Any]) -> tuple[str, ...]:
    statics, engines = (
        ", ".join(f"{angle:.1f}" for angle in item[name])
        for name in ("statics_tilt_deg", "reference_tilt_deg")
    )
    number, margin = str(item["body"]), f"{item['margin_deg']:.1f}"
    return item["problem"], number, statics, engines, margin, item["cause"]


def write_csv(path: Path, figures: Sequence[dict[str, Any]]) -> None:
    """Writes a row per problem and pair: share within 0.5° and its interval."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["problem", "pair", "n", "share", "low", "high", "median_deg", "touch"])
        for item in figures:
            sides = {f"statics and {run}": pair for run, pair in item["statics_and"].items()}
            for name, pair in {**sides, **item["ceilings"]}.items():
                numbers = [*pair["within"].values(), pair["median_deg"], pair["touch_alike"]]
                writer.writerow([item["problem"], name, *(f"{number:.6g}" for number in numbers)])


def publish(page: Path, measured: str) -> None:
    """Puts the tables into their place in a page.

    Raises:
        EstimatorError: The page has no such place.
    """
    text = page.read_text("utf-8")
    before, begin, rest = text.partition(_BEGIN)
    _, end, after = rest.partition(_END)
    if not begin or not end:
        raise EstimatorError(f"{page} has no lines {_BEGIN!r} and {_END!r} to write between")
    page.write_text(f"{before}{begin}\n\n{measured}\n{end}{after}", encoding="utf-8")


def _interval(part: dict[str, float]) -> str:
    if math.isnan(part["share"]):
        return "–"
    return f"{_percent(part['share'])} ({100 * part['low']:.1f}–{100 * part['high']:.1f})"


def _percent(part: float) -> str:
    return "–" if math.isnan(part) else f"{100 * part:.1f} %"


def plot_differences(path: Path, everything: Sequence[Compared]) -> None:
    """Plots the share of poses that differ by more: statics to engines, and engines to engines."""
    figure, panels = _panels(len(everything))
    for axes, compared in zip(panels, everything, strict=True):
        for colour, run in zip(COLOURS, _CURVES, strict=False):
            counted = compared.counted(run)
            label = f"statics – {RUNS[run].label}"
            _tail(axes, compared.differences(run)[counted], label, colour, "-")
        for colour, (one, two) in zip(COLOURS, _SELF, strict=False):
            first, second = compared.simulated[one], compared.simulated[two]
            angles = differences(first, second)[first.valid & second.valid]
            _tail(axes, angles, f"{RUNS[one].label} – {RUNS[two].label}", colour, ":")
        axes.axvline(CLOSE, color="0.7", linewidth=0.8)
        axes.set(xscale="log", yscale="log", xlim=(_LEAST_ANGLE, 180), ylim=(5e-4, 1))
        axes.set(title=compared.problem, xlabel="difference of tilt (°)")
    panels[0].set_ylabel("share that differs by more")
    _save(figure, path)


def plot_risk(path: Path, everything: Sequence[Compared]) -> None:
    """Plots risk over coverage: share of poses over 0.5° apart among those of largest margin."""
    figure, panels = _panels(len(everything))
    for axes, compared in zip(panels, everything, strict=True):
        for colour, run in zip(COLOURS, _CURVES, strict=False):
            kept, risk = risk_coverage(compared, run)
            axes.plot(100 * kept, 100 * risk, color=colour, linewidth=1.1, label=RUNS[run].label)
        axes.axvline(100 * COVERED, color="0.7", linewidth=0.8)
        axes.set(title=compared.problem, xlabel="poses kept, largest margins first (%)")
        axes.set(xlim=(0, 100), ylim=(0, 8))
    panels[0].set_ylabel("of these, over 0.5° apart (%)")
    _save(figure, path)


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    figure = new_figure(3.2 * count, 3.6)
    panels = figure.subplots(1, count, sharey=True, squeeze=False)
    return figure, list(panels[0])


def _tail(axes: Axes, values: Array, label: str, colour: str, line: str) -> None:
    ordered = np.sort(np.maximum(values, _LEAST_ANGLE))
    share = 1 - np.arange(len(ordered)) / max(1, len(ordered))
    axes.plot(ordered, share, line, color=colour, linewidth=1.1, label=label)


def _save(figure: Figure, path: Path) -> None:
    lines = figure.axes[0].get_legend_handles_labels()
    figure.legend(*lines, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=_DPI)
