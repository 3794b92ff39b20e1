"""The bodies of a run as one picture, in the pose of the last interaction."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from estimator.report.bodies.camera import reach, take_picture
from estimator.report.bodies.shown_bodies import ShownBody
from estimator.report.plots.canvas import leg_patches, new_figure
from protocol.text import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANELS: Final = 3
"""Bodies in a picture, at most: the best, a rival or two, the truth."""

_WIDTH: Final = 38  # characters of a note in a line


def body_picture(bodies: Sequence[ShownBody], legs: Sequence[str]) -> Figure:
    """Draws bodies side by side, from the same camera.

    Args:
        bodies: As shown on the page; at least one.
        legs: Names of the legs' joints.
    """
    truth = [item for item in bodies if item.true]
    chosen = [item for item in bodies if not item.true][: PANELS - len(truth)] + truth
    radius = max(reach(item.standing) for item in chosen)
    figure = new_figure(4.0 * len(chosen), 4.4)
    for axes, item in zip(figure.subplots(1, len(chosen), squeeze=False)[0], chosen, strict=True):
        axes.imshow(take_picture(item.standing, radius))
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_visible(False)
        axes.set_title(item.title, loc="left")
        note = textwrap.fill(printable(item.note), _WIDTH)
        axes.set_xlabel(note, loc="left", fontsize="small", parse_math=False)
    legend = figure.legend(
        handles=leg_patches(legs),
        loc="outside lower left",
        ncols=min(len(legs), 3 * len(chosen)),
        frameon=False,
        fontsize="small",
    )
    for text in legend.get_texts():
        text.set_parse_math(False)  # a name may hold dollar signs
    return figure
