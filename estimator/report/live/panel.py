"""The text of the live page: verdict, progress, legs, and why each movement was made."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from markupsafe import Markup

from estimator.report.canvas import leg_colour
from estimator.report.live.run_view import RunView
from estimator.report.page.templates import render
from estimator.storage.records import InteractionRecord

_TEMPLATE = "live_panel.html"


def panel(view: RunView, directory: Path) -> str:
    """The panel as HTML."""
    return render(
        _TEMPLATE,
        sentence="",
        view=view,
        directory=directory,
        legs=list(_legs(view)),
        movements=list(_movements(view))[::-1],
    )


def sentence_alone(sentence: str) -> str:
    """The panel with a sentence in place of all numbers."""
    return render(_TEMPLATE, sentence=sentence)


def _legs(view: RunView) -> Iterator[tuple[str, ...]]:
    result = view.result
    for number, (leg, length) in enumerate(zip(result.legs, result.leg_intervals, strict=True)):
        dot = Markup('<span style="color:{}">⬤</span> {}').format(leg_colour(number), leg.joint)
        interval = f"{1000 * length.low:.0f}–{1000 * length.high:.0f}"
        yield dot, leg.mount, f"{1000 * length.median:.0f} mm", interval, leg.touched_in_words


def _movements(view: RunView) -> Iterator[tuple[str, str]]:
    """Why each movement was made, and the information in it."""
    posterior = view.result.posterior
    steps = () if posterior is None else posterior.steps
    for number, item in enumerate(view.interactions):
        told = [] if item.bits is None else [f"{item.bits:.1f} bits expected"]
        if number < len(steps):
            if (gained := steps[number].gained_bits) is not None:
                told.append(f"{gained:.1f} bits gained")
            sure = steps[number].probability
            told.append("not known how sure" if sure is None else f"then {100 * sure:.0f} % sure")
            if not steps[number].explained:
                told.append("but not explained")
        small = Markup('<br><span style="opacity:0.7">{}</span>').format(", ".join(told))
        reason = Markup("{}").format(item.reason or _angles(item))
        yield str(number + 1), reason + small if told else reason


def _angles(interaction: InteractionRecord) -> str:
    angles = (f"{round(math.degrees(angle)):+d}°" for angle in interaction.program)
    return ", ".join(angles).replace("-", "−")
