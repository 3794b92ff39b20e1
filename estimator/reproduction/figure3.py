"""Figure 3: how good the best models are, by what they were fitted to, after each iteration."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from estimator.body.limbs import leg_lengths
from estimator.body.morphology import Array
from estimator.problem.genome import Genome
from estimator.randomness import Stream, generator
from estimator.report.canvas import new_figure
from estimator.reproduction.figure import DrawnFigure, read_finished, write_figure
from estimator.reproduction.paper_claims import Samples, mean_and_deviation
from estimator.reproduction.paper_runs import VARIANTS, Budget, parametric_runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAME: Final = "fig3"
CAPTION: Final = (
    "Model quality by available sensor data, at the end of each iteration: of each run the best "
    "model by subjective error, beside the robot. a: mean of |leg length - true leg length|. "
    "b: longest minus shortest leg. Bars: mean over the runs; whiskers: one standard deviation. "
    "Dashed lines: models drawn at random. Columns within a group, from left to right: "
    + "; ".join(f"{variant.number} {', '.join(variant.modalities)}" for variant in VARIANTS)
    + "."
)
RANDOM_MODELS: Final = 5000
_SEED: Final = 0  # of the random models
_COLOURS: Final = ("#1b4f72", "#2e86c1", "#85929e", "#1e8449", "#bfc9ca", "#82c99d", "#566573")
"""Colours of the variants: blue and green with tilt, grey without."""

MEASURES: Final[Mapping[str, Callable[[Array, Array], Array]]] = MappingProxyType(
    {
        "mean_leg_error_m": lambda lengths, true: np.mean(np.abs(lengths - true), axis=1),
        "longest_minus_shortest_m": lambda lengths, true: np.ptp(lengths, axis=1),
        "variance_m2": lambda lengths, true: np.var(lengths, axis=1),
    }
)
"""How good leg lengths are, by name: Figure 3a; 3b by its caption; 3b by the text.

Each takes the lengths of some models, m, shape (models, legs), and the robot's, shape (legs,).
"""

HEADER: Final = ("variant", "modalities", "iteration", "seed", *MEASURES)
_PANELS: Final = (
    ("a", "mean_leg_error_m", "mean |leg - true leg| (mm)", 1e3),
    ("b", "longest_minus_shortest_m", "longest - shortest leg (mm)", 1e3),
)


def quality(lengths: Array, true_lengths: Array) -> dict[str, Array]:
    """Quality of some models by each measure, shape (models,)."""
    return {name: measure(lengths, true_lengths) for name, measure in MEASURES.items()}


def random_models(genome: Genome, true_lengths: Array) -> dict[str, Array]:
    """Quality of models whose genes were drawn at random, as the first population's are."""
    genes = generator(_SEED, Stream.RANDOM_MODELS).random((RANDOM_MODELS, genome.size))
    return quality(leg_lengths(genome.decode_all(genes)), true_lengths)


_Measured: TypeAlias = Mapping[tuple[int, int], Mapping[str, Sequence[float]]]
"""Quality of each run's best models, by variant and seed: by measure, an iteration each."""


def make(root: Path, budget: Budget, runs: int | None) -> tuple[DrawnFigure, Samples]:
    """Draws the figure and writes its files; returns it and the samples that claims are about."""
    measured: dict[tuple[int, int], Mapping[str, Sequence[float]]] = {}
    chance: dict[str, Array] = {}
    for variant in VARIANTS:
        for run in read_finished(root, parametric_runs(variant, runs, budget)):
            lengths = np.array([run.best_lengths(end) for end in run.iteration_ends])
            qualities = quality(lengths, run.true_lengths).items()
            of_run = {name: values.tolist() for name, values in qualities}
            measured[variant.number, run.planned.seed] = of_run
            chance = chance or random_models(run.genome, run.true_lengths)
    if not measured:
        return DrawnFigure.missing(NAME, CAPTION), {}
    iterations = max(len(values) for of_run in measured.values() for values in of_run.values())
    picture = new_figure(11, 8)
    for axes, (panel, measure, label, scale) in zip(picture.subplots(2, 1), _PANELS, strict=True):
        _draw(axes, measured, iterations, measure, scale)
        level = float(np.mean(chance[measure])) * scale
        axes.axhline(level, color="0.25", linestyle="--", linewidth=1, label="random models")
        axes.set_ylabel(label)
        axes.set_title(panel, loc="left")
        axes.set_ylim(bottom=0)
    picture.legend(
        *picture.axes[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=4,
        frameon=False,
    )
    numbers = {
        "caption": CAPTION,
        "iterations": iterations,
        "columns": [list(variant.modalities) for variant in VARIANTS],
        "bars": _bars(measured, iterations),
        "random_models": {
            name: {"mean": float(np.mean(values)), "standard_deviation": float(np.std(values))}
            for name, values in chance.items()
        },
    }
    write_figure(
        root,
        NAME,
        picture,
        header=HEADER,
        rows=[
            (number, VARIANTS[number - 1].name, iteration, seed, *values)
            for (number, seed), of_run in measured.items()
            for iteration, values in enumerate(zip(*of_run.values(), strict=True), 1)
        ],
        numbers=numbers,
    )
    sentences = _sentences(measured, iterations, chance)
    samples: dict[Any, dict[int, float]] = {
        (f"3{panel}", variant.number): _by_seed(measured, variant.number, iterations, measure)
        for variant in VARIANTS
        for panel, measure, _, _ in _PANELS
    }
    return DrawnFigure(name=NAME, caption=CAPTION, sentences=sentences), samples


def _by_seed(measured: _Measured, variant: int, iteration: int, measure: str) -> dict[int, float]:
    """Quality of the runs of a variant at the end of an iteration, by seed."""
    return {
        seed: of_run[measure][iteration - 1]
        for (number, seed), of_run in measured.items()
        if number == variant and iteration <= len(of_run[measure])
    }


def _draw(axes: Axes, measured: _Measured, iterations: int, measure: str, scale: float) -> None:
    width = 0.8 / len(VARIANTS)
    for column, (variant, colour) in enumerate(zip(VARIANTS, _COLOURS, strict=True)):
        heights, whiskers = [], []
        for iteration in range(1, iterations + 1):
            values = _by_seed(measured, variant.number, iteration, measure)
            mean, deviation = mean_and_deviation([*values.values()])
            heights.append((mean or 0.0) * scale)
            whiskers.append((deviation or 0.0) * scale)
        positions = np.arange(1, iterations + 1) + (column - (len(VARIANTS) - 1) / 2) * width
        axes.bar(
            positions,
            heights,
            width * 0.9,
            yerr=whiskers,
            color=colour,
            error_kw={"elinewidth": 0.8, "capsize": 1.5},
            label=f"{variant.number} {', '.join(variant.modalities)}",
        )
    axes.set_xticks(range(1, iterations + 1))
    axes.set_xlabel("iteration")
    axes.spines[["top", "right"]].set_visible(False)


def _bars(measured: _Measured, iterations: int) -> list[dict[str, Any]]:
    bars: list[dict[str, Any]] = []
    for iteration in range(1, iterations + 1):
        for variant in VARIANTS:
            bar: dict[str, Any] = {"iteration": iteration, "variant": variant.number}
            for measure in MEASURES:
                values = _by_seed(measured, variant.number, iteration, measure)
                mean, deviation = mean_and_deviation([*values.values()])
                bar["runs"] = len(values)
                bar[measure] = {"mean": mean, "standard_deviation": deviation}
            bars.append(bar)
    return bars


def _sentences(measured: _Measured, iterations: int, chance: dict[str, Array]) -> tuple[str, ...]:
    sentences = []
    for panel, measure, _, scale in _PANELS:
        parts = []
        for variant in VARIANTS:
            values = _by_seed(measured, variant.number, iterations, measure)
            mean, deviation = mean_and_deviation([*values.values()])
            if mean is not None:
                whisker = "" if deviation is None else f" ± {deviation * scale:.0f}"
                parts.append(f"{variant.number}: {mean * scale:.0f}{whisker}")
        sentences.append(
            f"{panel}, after iteration {iterations} (mm): {'; '.join(parts)}; random models "
            f"{float(np.mean(chance[measure])) * scale:.0f}."
        )
    return tuple(sentences)
