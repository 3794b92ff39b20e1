"""Errors and leg lengths over generations, drawn as in the paper's Figure 2."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from estimator.body.limbs import driven_limbs
from estimator.problem.genome import Genome
from estimator.storage.records import Generation
from protocol.text.printable import printable

MARKERS: Final = {"left": "<", "front": "^", "right": ">", "back": "v"}
"""The paper's arrows: left, forward, right and back leg."""

OTHER_MARKERS: Final = ("s", "D", "P", "X", "*", "p", "h", "d")
"""For legs on a side that has its arrow already."""

COLOURS: Final = (
    *("#0072b2", "#d55e00", "#009e73", "#cc79a7"),
    *("#e69f00", "#56b4e9", "#000000", "#8c510a"),
)
"""Told apart by the colour-blind."""
_DPI: Final = 120
ABOVE: Final[dict[str, Any]] = {
    **{"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.1},
    **{"frameon": False, "fontsize": "small", "columnspacing": 1.0, "handlelength": 1.4},
}
"""Where a legend hides nothing."""


def plot_errors(path: Path, generations: Sequence[Generation]) -> None:
    """The subjective error of every model over generations; a line where an iteration ends."""
    figure, axes = new_axes()
    draw_errors(axes, generations)
    save(figure, path)


def draw_errors(axes: Axes, generations: Sequence[Generation]) -> None:
    """The same into a panel."""
    label(axes, "subjective error of each model")
    for generation in generations:
        errors = np.array(generation.errors)
        errors = errors[np.isfinite(errors)]
        axes.plot(
            np.full(len(errors), generation.number), errors, ".", color="0.55", markersize=2.5
        )
    best = [min(generation.errors) for generation in generations]
    axes.plot(range(len(best)), best, "-", color=COLOURS[0], linewidth=1.2, label="best model")
    axes.set_yscale("log" if min(best) > 0 else "linear")  # an objective may well reach 0
    axes.legend(**ABOVE)
    mark_iterations(axes, generations)


def plot_lengths(
    path: Path,
    generations: Sequence[Generation],
    genome: Genome,
    names: Sequence[str],
    targets: Sequence[float] = (),
) -> None:
    """The best model's leg lengths over generations.

    Args:
        path: Where to write.
        generations: The run's generations.
        genome: Decodes them.
        names: Names of the legs' joints.
        targets: True length of each leg, m; dots at the right, where they are known.
    """
    figure, axes = new_axes()
    draw_lengths(axes, generations, genome, names, targets=targets)
    save(figure, path)


def draw_lengths(
    axes: Axes,
    generations: Sequence[Generation],
    genome: Genome,
    names: Sequence[str],
    *,
    targets: Sequence[float] = (),
    sides: Sequence[str] = (),
) -> None:
    """The same into a panel.

    Args:
        axes: The panel.
        generations: The run's generations.
        genome: Decodes them.
        names: Names of the legs' joints.
        targets: True length of each leg, m, where they are known.
        sides: Where each leg sits, for its arrow; default: where it does on the last best model.
            Of several legs on a side the first has the arrow.
    """
    label(axes, "leg length of the best model (cm)")
    bodies = [genome.decode(np.array(generation.best)) for generation in generations]
    numbers = [generation.number for generation in generations]
    legs = [[driven_limbs(body)[leg] for body in bodies] for leg in range(len(names))]
    markers = leg_markers(sides or [limbs[-1].side_name for limbs in legs])
    for leg, (name, limbs) in enumerate(zip(names, legs, strict=True)):
        colour = COLOURS[leg % len(COLOURS)]
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
        legend = axes.legend(ncols=min(5, len(names) + bool(targets)), **ABOVE)
        for text in legend.get_texts():
            text.set_parse_math(False)  # a name may hold dollar signs
    mark_iterations(axes, generations)


def leg_markers(sides: Sequence[str]) -> list[str]:
    """A marker for each leg; no two share one as long as there are enough."""
    markers: list[str] = []
    for side in sides:
        free = [mark for mark in (MARKERS[side], *OTHER_MARKERS) if mark not in markers]
        markers.append(free[0] if free else MARKERS[side])
    return markers


def leg_label(name: str) -> str:
    """A name as a legend takes it: printable, and without the underscore that would hide it."""
    return printable(f" {name}" if name.startswith("_") else name)


def new_axes() -> tuple[Figure, Axes]:
    """A figure with one panel."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.add_subplot()


def label(axes: Axes, quantity: str) -> None:
    """Names the axes of a panel over generations."""
    axes.set_xlabel("generation")
    axes.set_ylabel(quantity)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def mark_iterations(axes: Axes, generations: Sequence[Generation]) -> None:
    """A vertical line where an iteration ends and a new interaction comes in."""
    last = {generation.iteration: generation.number for generation in generations}
    for number in last.values():
        axes.axvline(number + 0.5, color="0.2", linewidth=0.7, linestyle=":")


def save(figure: Figure, path: Path) -> None:
    """Writes a figure, in a folder that need not exist yet."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=_DPI)
