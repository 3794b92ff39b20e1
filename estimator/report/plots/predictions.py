"""What was felt in each interaction beside what the best body foretells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from estimator.body.morphology import Array
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation
from estimator.report.plots.canvas import new_figure
from estimator.report.plots.generations import ABOVE
from estimator.report.plots.leg_styles import COLOURS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PANELS: Final = ("tilt left/right (°)", "tilt forward/back (°)", "clearance (mm)")


def plot_predictions(felt: Sequence[Observation], foretold: Sequence[Observation | None]) -> Figure:
    """Tilt and clearance in each interaction; what is missing is left out.

    Args:
        felt: By the robot.
        foretold: By the best body; ``None`` where its simulation cannot be believed.
    """
    figure = new_figure(9.0, 3.2)
    numbers = np.arange(1, len(foretold) + 1)
    one, other = (
        np.array([_numbers(item) for item in items]) for items in (felt[: len(foretold)], foretold)
    )
    panels = figure.subplots(1, len(_PANELS))
    for column, (axes, quantity) in enumerate(zip(panels, _PANELS, strict=True)):
        axes.set_xlabel("interaction")
        axes.set_ylabel(quantity)
        axes.set_xticks(numbers)
        axes.spines[["top", "right"]].set_visible(False)
        axes.plot(numbers, one[:, column], "o", color="0.25", markerfacecolor="none", label="felt")
        axes.plot(numbers, other[:, column], "x", color=COLOURS[0], label="foretold")
    panels[-1].legend(ncols=2, **ABOVE)
    return figure


def _numbers(item: Observation | None) -> Array:
    if item is None:
        return np.full(3, np.nan)
    shown = (MODALITIES[name] for name in ("tilt", "clearance"))
    return np.concatenate([one.error_factor * one.observed(item) for one in shown])
