"""Figures before and after they are drawn; the first one loads Matplotlib, which takes a second."""

from __future__ import annotations

import importlib
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from estimator.report.plots.leg_styles import leg_colour, leg_label
from protocol.system.process import interrupts_deferred

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

DPI: Final = 120
_NO_METADATA: Final = dict.fromkeys(("Creator", "Date", "Format", "Type"))


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, its size in inches."""
    with interrupts_deferred():
        make: type[Figure] = importlib.import_module("matplotlib.figure").Figure
        importlib.import_module("matplotlib.backends.backend_agg")  # which draws it
    return make(figsize=(width, height), dpi=DPI, layout="constrained")


def new_axes() -> tuple[Figure, Axes]:
    """A figure with one panel."""
    figure = new_figure(7.0, 4.2)
    return figure, figure.add_subplot()


def leg_patches(names: Sequence[str]) -> list[Patch]:
    """A legend's patch for each leg, in its colour; ``names`` are those of the legs' joints."""
    patch: type[Patch] = importlib.import_module("matplotlib.patches").Patch
    return [patch(color=leg_colour(leg), label=leg_label(name)) for leg, name in enumerate(names)]


def as_png(figure: Figure) -> bytes:
    """A figure as a picture."""
    content = io.BytesIO()
    _laid_out(figure).print_png(content)  # Figure.savefig draws twice
    return content.getvalue()


def as_svg(figure: Figure) -> str:
    """A figure as an SVG element, transparent, the same bytes each time, its text as text."""
    content = io.StringIO()
    for background in (figure.patch, *(axes.patch for axes in figure.axes)):
        background.set_facecolor("none")
    _laid_out(figure)
    fixed = {"svg.fonttype": "none", "svg.hashsalt": "bodyschema"}
    backend = importlib.import_module("matplotlib.backends.backend_svg")
    with importlib.import_module("matplotlib").rc_context(fixed):
        backend.FigureCanvasSVG(figure).print_svg(content, metadata=_NO_METADATA)
    text = content.getvalue()
    return text[text.index("<svg") :]


def _laid_out(figure: Figure) -> Any:
    """A figure's canvas, all in its place: found once, for one format as for another."""
    backend = importlib.import_module("matplotlib.backends.backend_agg")
    canvas = backend.FigureCanvasAgg(figure)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")
    return canvas
