"""How belief grew: each leg's length with its interval, and how sure the attachments are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from estimator.body.limbs import driven_limbs
from estimator.posterior.fitted import FittedPosterior
from estimator.report.plots.canvas import new_axes
from estimator.report.plots.generations import ABOVE, label, legend_of_names
from estimator.report.plots.leg_styles import leg_colour, leg_label, leg_markers
from estimator.report.posterior.summary import length_intervals
from estimator.storage.beliefs import Belief

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_APART: Final = 0.08  # of an interaction, between the legs' marks


def plot_interval_lengths(
    history: Sequence[FittedPosterior],
    names: Sequence[str],
    targets: Sequence[float] = (),
) -> Figure:
    """Median and 90 % interval of each leg's length after each interaction.

    Args:
        history: After each interaction.
        names: Names of the legs' joints.
        targets: True length of each leg, m, where they are known.
    """
    figure, axes = new_axes()
    label(axes, "leg length (cm), 90 % interval")
    axes.set_xlabel("interaction")
    intervals = [length_intervals(one.leg_lengths, one.weights) for one in history]
    last = history[-1].best_body
    assert last is not None
    markers = leg_markers([limb.mount for limb in driven_limbs(last)])
    for leg, name in enumerate(names):
        low, median, high = (
            100 * np.array([(one[leg].low, one[leg].median, one[leg].high) for one in intervals]).T
        )
        colour = leg_colour(leg)
        at = np.arange(1, len(history) + 1) + _APART * (leg - (len(names) - 1) / 2)
        axes.errorbar(
            at,
            median,
            yerr=[median - low, high - median],
            linestyle="none",
            marker=markers[leg],
            color=colour,
            markersize=4.5,
            elinewidth=1.0,
            label=leg_label(name),
        )
        if targets:
            axes.plot(len(history) + 0.7, targets[leg] * 100, "o", color=colour, markersize=6)
    if targets:
        axes.plot([], [], "o", color="0.3", label="true length")
    axes.set_ylim(bottom=0)
    axes.set_xticks(range(1, len(history) + 1))
    if names:
        legend_of_names(axes, columns=min(5, len(names) + bool(targets)))
    return figure


def plot_belief(beliefs: Sequence[Belief], expected: Sequence[float | None]) -> Figure:
    """Probability of the attachments after each interaction, and the information that each gave.

    Args:
        beliefs: After each interaction.
        expected: Information that each was expected to give, bits, where it was known.
    """
    figure, axes = new_axes()
    label(axes, "stated probability of the attachments")
    axes.set_xlabel("interaction")
    numbers = np.arange(1, len(beliefs) + 1)
    axes.plot(
        numbers,
        [np.nan if one.probability is None else one.probability for one in beliefs],
        "o-",
        color=leg_colour(0),
        label="sure",
    )
    axes.set_ylim(0, 1.02)
    axes.set_xticks(numbers)
    bits = axes.twinx()
    bits.set_ylabel("information (bits)")
    bits.spines["top"].set_visible(False)
    told = [np.nan if one is None else one for one in expected]
    gained = [np.nan if belief.gained is None else belief.gained for belief in beliefs]
    bits.bar(numbers - 0.15, told, width=0.28, color=leg_colour(5), alpha=0.5, label="expected")
    bits.bar(numbers + 0.15, gained, width=0.28, color=leg_colour(2), alpha=0.5, label="gained")
    handles, labels = axes.get_legend_handles_labels()
    more, names = bits.get_legend_handles_labels()
    axes.legend(handles + more, labels + names, ncols=3, **ABOVE)
    return figure
