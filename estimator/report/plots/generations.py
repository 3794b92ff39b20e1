"""Errors and leg lengths over generations, drawn as in the paper's Figure 2."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from estimator.body.limbs import driven_limbs
from estimator.problem.genome import Genome
from estimator.report.plots.leg_styles import leg_colour, leg_label, leg_markers
from estimator.storage.records import Generation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ABOVE: Final[dict[str, Any]] = {
    **{"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.1},
    **{"frameon": False, "fontsize": "small", "columnspacing": 1.0, "handlelength": 1.4},
}
"""Where a legend hides nothing."""


def draw_errors(axes: Axes, generations: Sequence[Generation]) -> None:
    """The subjective error of every model over generations; a line where an iteration ends."""
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
    """The best model's leg lengths over generations.

    Args:
        axes: The panel.
        generations: The run's generations.
        genome: Decodes them.
        names: Names of the legs' joints.
        targets: True length of each leg, m; dots at the right, where they are known.
        mounts: Where each leg sits, for its arrow; default: where it does on the last best model.
            Of several legs on a mount the first has the arrow.
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
        if targets:
            axes.plot(numbers[-1] + 1.5, targets[leg] * 100, "o", color=colour, markersize=6)
    if targets:
        axes.plot([], [], "o", color="0.3", label="true length")
    axes.set_ylim(bottom=0)
    if names:
        legend_of_names(axes, columns=min(5, len(names) + bool(targets)))
    mark_iterations(axes, generations)


def label(axes: Axes, quantity: str) -> None:
    """Names the axes of a panel over generations."""
    axes.set_xlabel("generation")
    axes.set_ylabel(quantity)
    axes.spines[["top", "right"]].set_visible(False)


def legend_of_names(axes: Axes, *, columns: int) -> None:
    """A legend above a panel, with names as they are: they may hold dollar signs."""
    for text in axes.legend(ncols=columns, **ABOVE).get_texts():
        text.set_parse_math(False)


def mark_iterations(axes: Axes, generations: Sequence[Generation]) -> None:
    """A vertical line where an iteration ends and a new interaction comes in."""
    last = {generation.iteration: generation.number for generation in generations}
    for number in last.values():
        axes.axvline(number + 0.5, color="0.2", linewidth=0.7, linestyle=":")
