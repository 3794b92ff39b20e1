"""Figures, and each leg's colour, marker and label; the first figure loads Matplotlib."""

from __future__ import annotations

import colorsys
import importlib
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from protocol.system.process import interrupts_deferred
from protocol.text import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

DPI: Final = 120
_NO_METADATA: Final = dict.fromkeys(("Creator", "Date", "Format", "Type"))


def new_figure(width: float, height: float) -> Figure:
    """Returns an empty figure; width and height are in inches."""
    with interrupts_deferred():
        figure_class: type[Figure] = importlib.import_module("matplotlib.figure").Figure
        importlib.import_module("matplotlib.backends.backend_agg")  # draws the figure
    return figure_class(figsize=(width, height), dpi=DPI, layout="constrained")


def new_axes() -> tuple[Figure, Axes]:
    """Returns a figure with one panel, and the panel."""
    figure = new_figure(7.0, 4.2)
    return figure, figure.add_subplot()


def leg_patches(names: Sequence[str]) -> list[Patch]:
    """A legend's patch for each leg, in its colour; ``names`` are those of the legs' joints."""
    patch: type[Patch] = importlib.import_module("matplotlib.patches").Patch
    return [patch(color=leg_colour(leg), label=leg_label(name)) for leg, name in enumerate(names)]


def as_png(figure: Figure) -> bytes:
    """Returns a figure as a PNG."""
    content = io.BytesIO()
    _laid_out(figure).print_png(content)  # Figure.savefig draws twice
    return content.getvalue()


def as_svg(figure: Figure) -> str:
    """Returns a figure as an SVG element: transparent, the same bytes each time, text as text."""
    content = io.StringIO()
    for background in (figure.patch, *(axes.patch for axes in figure.axes)):
        background.set_facecolor("none")
    _laid_out(figure)
    svg_options = {"svg.fonttype": "none", "svg.hashsalt": "bodyschema"}
    backend = importlib.import_module("matplotlib.backends.backend_svg")
    with importlib.import_module("matplotlib").rc_context(svg_options):
        backend.FigureCanvasSVG(figure).print_svg(content, metadata=_NO_METADATA)
    text = content.getvalue()
    return text[text.index("<svg") :]


def _laid_out(figure: Figure) -> Any:
    """A figure's canvas after its layout, which is computed once for all formats."""
    backend = importlib.import_module("matplotlib.backends.backend_agg")
    canvas = backend.FigureCanvasAgg(figure)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")
    return canvas


MARKERS: Final = {"left": "<", "front": "^", "right": ">", "back": "v"}
"""The paper's arrows for its left, forward, right and back leg, by mount."""

OTHER_MARKERS: Final = ("s", "D", "P", "X", "*", "p", "h", "d")
"""Markers of legs on a mount whose arrow is taken, or on none of the four; then come numbers."""

COLOURS: Final = (
    *("#0072b2", "#d55e00", "#009e73", "#cc79a7"),
    *("#e69f00", "#56b4e9", "#5e3c99", "#8c510a"),
)
"""Colours of the first legs, distinct to the colour-blind."""

_HUE_STEP: Final = 0.381966  # step between hues, in circles: however many are taken, none recurs
_LIGHTNESS: Final = (0.33, 0.52, 0.70)
_MAX_NAME_LENGTH: Final = 20  # largest number of characters of a name in a legend


def leg_colour(leg: int) -> str:
    """The colour of a leg, by its motor's place in motor order, as ``#rrggbb``."""
    if leg < len(COLOURS):
        return COLOURS[leg]
    further = leg - len(COLOURS)
    lightness = _LIGHTNESS[further % len(_LIGHTNESS)]
    channels = colorsys.hls_to_rgb(further * _HUE_STEP % 1, lightness, 0.6)
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in channels)


def leg_label(name: str) -> str:
    """A name for a legend: printable, short, without an underscore at its start, which hides it."""
    short = name if len(name) <= _MAX_NAME_LENGTH else f"{name[: _MAX_NAME_LENGTH - 1]}…"
    return printable(f" {short}" if short.startswith("_") else short)


def leg_markers(mounts: Sequence[str]) -> list[str]:
    """A matplotlib marker for each leg, no two the same.

    Args:
        mounts: Mount of each leg. The first leg on each of the paper's four has its arrow.
    """
    markers: list[str] = []
    for leg, mount in enumerate(mounts, 1):
        preferred = [MARKERS[mount]] if mount in MARKERS else []
        free = [mark for mark in (*preferred, *OTHER_MARKERS) if mark not in markers]
        markers.append(free[0] if free else f"${leg}$")
    return markers
