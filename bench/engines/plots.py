"""Pictures: how far apart, and how sure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.engines.figures import CLOSE, COVERED, Compared, differences, risk_coverage
from bench.engines.runs import RUNS
from estimator.body.morphology import Array
from estimator.report.canvas import COLOURS

_DPI: Final = 110
_LEAST: Final = 1e-4  # degrees; smaller differences are drawn here
_CURVES: Final = ("fine", "inert", "coarse", "mujoco")
_SELF: Final = (("coarse", "fine"), ("inert", "fine"), ("mujoco", "fine"))


def plot_differences(path: Path, everything: Sequence[Compared]) -> None:
    """Share of poses that differ by more than so much: statics, and the engines themselves."""
    figure, panels = _panels(len(everything))
    for axes, compared in zip(panels, everything, strict=True):
        for colour, run in zip(COLOURS, _CURVES, strict=False):
            counted = compared.counted(run)
            label = f"statics – {RUNS[run].label}"
            _tail(axes, compared.differences(run)[counted], label, colour, "-")
        for colour, (one, two) in zip(COLOURS, _SELF, strict=False):
            first, second = compared.simulated[one], compared.simulated[two]
            apart = differences(first, second)[first.valid & second.valid]
            _tail(axes, apart, f"{RUNS[one].label} – {RUNS[two].label}", colour, ":")
        axes.axvline(CLOSE, color="0.7", linewidth=0.8)
        axes.set(xscale="log", yscale="log", xlim=(_LEAST, 180), ylim=(5e-4, 1))
        axes.set(title=compared.problem, xlabel="difference of tilt (°)")
    panels[0].set_ylabel("share that differs by more")
    panels[0].legend(frameon=False, fontsize=6, loc="lower left")
    _save(figure, path)


def plot_risk(path: Path, everything: Sequence[Compared]) -> None:
    """Risk–coverage: share of poses over 0.5° apart among those with the largest margins."""
    figure, panels = _panels(len(everything))
    for axes, compared in zip(panels, everything, strict=True):
        for colour, run in zip(COLOURS, _CURVES, strict=False):
            kept, risk = risk_coverage(compared, run)
            axes.plot(100 * kept, 100 * risk, color=colour, linewidth=1.1, label=RUNS[run].label)
        axes.axvline(100 * COVERED, color="0.7", linewidth=0.8)
        axes.set(title=compared.problem, xlabel="poses kept, largest margins first (%)")
        axes.set(xlim=(0, 100), ylim=(0, 8))
    panels[0].set_ylabel("of these, over 0.5° apart (%)")
    panels[0].legend(frameon=False, fontsize=7, loc="upper left")
    _save(figure, path)


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(3.2 * count, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, count, sharey=True, squeeze=False)
    return figure, list(panels[0])


def _tail(axes: Axes, values: Array, label: str, colour: str, line: str) -> None:
    ordered = np.sort(np.maximum(values, _LEAST))
    above = 1 - np.arange(len(ordered)) / max(1, len(ordered))
    axes.plot(ordered, above, line, color=colour, linewidth=1.1, label=label)


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=_DPI)
