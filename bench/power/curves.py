"""How often the body is found against movements and against CPU time: a picture."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.power.tables import Runs, by_interaction, share_right
from estimator.report.canvas import COLOURS, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARKERS: Final = "os^D"
_SHADE: Final = 0.15  # opacity of the 95 % interval


def plot_success(runs: Runs) -> Figure:
    """Share of runs in which all attachments are right, with its 95 % interval (Wilson).

    Args:
        runs: A group's; each trial is a line.
    """
    figure = new_figure(8.4, 3.4)
    by_movement, by_seconds = figure.subplots(1, 2, sharey=True)
    for (trial, figures), colour, marker in zip(runs, COLOURS, _MARKERS, strict=False):
        steps = list(by_interaction(figures))
        shares = np.array([share_right(some) for some in steps])
        seconds = [np.mean([step.cpu_seconds for _, step in some]) for some in steps]
        for axes, places in ((by_movement, range(1, len(steps) + 1)), (by_seconds, seconds)):
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
    figure.legend(handles, names, loc="outside upper right", ncols=len(runs), frameon=False)
    return figure
