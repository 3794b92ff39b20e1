"""How belief grew: each leg's length with its interval, and how sure the attachments are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from estimator.body.limbs import driven_limbs, leg_lengths
from estimator.body.morphology import Array
from estimator.problem.genome import Genome
from estimator.report.plots import ABOVE, COLOURS, label, leg_label, leg_markers, new_axes, save
from estimator.storage.beliefs import Belief

_INTERVAL: Final = (0.05, 0.5, 0.95)
_APART: Final = 0.08  # of an interaction, between the legs' marks


def plot_interval_lengths(
    path: Path,
    beliefs: Sequence[Belief],
    genome: Genome,
    names: Sequence[str],
    targets: Sequence[float] = (),
) -> None:
    """Median and 90 % interval of each leg's length after each interaction.

    Args:
        path: Where to write.
        beliefs: After each interaction.
        genome: Decodes their samples.
        names: Names of the legs' joints.
        targets: True length of each leg, m, where they are known.
    """
    figure, axes = new_axes()
    label(axes, "leg length (cm), 90 % interval")
    axes.set_xlabel("interaction")
    lengths = [leg_lengths(genome.decode_all(np.array(belief.genes))) for belief in beliefs]
    last = genome.decode(np.array(beliefs[-1].best))
    markers = leg_markers([limb.side_name for limb in driven_limbs(last)])
    for leg, name in enumerate(names):
        low, median, high = np.array(
            [
                100
                * np.quantile(one[:, leg], _INTERVAL, weights=belief.weights, method="inverted_cdf")
                for one, belief in zip(lengths, beliefs, strict=True)
            ]
        ).T
        colour = COLOURS[leg % len(COLOURS)]
        at = np.arange(1, len(beliefs) + 1) + _APART * (leg - (len(names) - 1) / 2)
        axes.errorbar(
            at,
            median,
            yerr=np.maximum([median - low, high - median], 0.0),
            fmt=markers[leg],
            color=colour,
            markersize=4.5,
            elinewidth=1.0,
            label=leg_label(name),
        )
        if targets:
            axes.plot(len(beliefs) + 0.7, targets[leg] * 100, "o", color=colour, markersize=6)
    if targets:
        axes.plot([], [], "o", color="0.3", label="true length")
    axes.set_ylim(bottom=0)
    axes.set_xticks(range(1, len(beliefs) + 1))
    if names:
        legend = axes.legend(ncols=min(5, len(names) + bool(targets)), **ABOVE)
        for text in legend.get_texts():
            text.set_parse_math(False)  # a name may hold dollar signs
    save(figure, path)


def plot_belief(path: Path, beliefs: Sequence[Belief], expected: Sequence[float | None]) -> None:
    """Probability of the attachments after each interaction, and the information that each gave.

    Args:
        path: Where to write.
        beliefs: After each interaction.
        expected: Information that each was expected to give, bits, where it was known.
    """
    figure, axes = new_axes()
    label(axes, "stated probability of the attachments")
    axes.set_xlabel("interaction")
    numbers = np.arange(1, len(beliefs) + 1)
    axes.plot(
        numbers, [belief.probability for belief in beliefs], "o-", color=COLOURS[0], label="sure"
    )
    axes.set_ylim(0, 1.02)
    axes.set_xticks(numbers)
    bits = axes.twinx()
    bits.set_ylabel("information (bits)")
    bits.spines["top"].set_visible(False)
    told = [np.nan if one is None else one for one in expected]
    gained = [np.nan if belief.gained is None else belief.gained for belief in beliefs]
    bits.bar(numbers - 0.15, told, width=0.28, color=COLOURS[5], alpha=0.5, label="expected")
    bits.bar(numbers + 0.15, gained, width=0.28, color=COLOURS[2], alpha=0.5, label="gained")
    handles, labels = axes.get_legend_handles_labels()
    more, names = bits.get_legend_handles_labels()
    axes.legend(handles + more, labels + names, ncols=3, **ABOVE)
    save(figure, path)


def _quantiles(lengths: Array, belief: Belief) -> Array:
    quantiles: Array = np.quantile(
        lengths, _INTERVAL, weights=belief.weights, method="inverted_cdf"
    )
    return quantiles
