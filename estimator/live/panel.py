"""The text of the live page: verdict, progress, legs, and why each movement was made.

Names and sentences come from robots and files that others made, so all of them are escaped.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import Final

from estimator.live.run_view import RunState, RunView
from estimator.report.plots.leg_styles import leg_colour
from estimator.report.posterior.summary import PosteriorSummary
from estimator.storage.records import InteractionRecord

_STYLE: Final = "font-size:0.85em;line-height:1.4;padding:0 0.75em 0.5em;overflow-wrap:anywhere;"
_CELL: Final = "padding:0.1em 0.5em 0.1em 0;text-align:left;vertical-align:top"


def panel(view: RunView, directory: Path) -> str:
    """The panel as HTML."""
    result, posterior = view.result, view.result.posterior
    pieces = [
        f"<b>{escape(result.problem)}</b> on {escape(str(result.robot['robot']))}, "
        f"seed {result.seed}",
        _state(view, directory),
        f'<progress style="width:100%" value="{view.progress.share:.3f}"></progress><br>'
        f"{escape(_capital(view.progress.sentence))}.",
    ]
    if posterior is not None:
        pieces.append(_verdict(posterior))
    elif result.sensor_error is not None:
        pieces.append(f"Sensor error of the best model: {result.sensor_error:.2f}.")
    pieces.append(_legs(view))
    pieces.append(_movements(view))
    pieces += [f"<i>{escape(warning)}</i>" for warning in result.warnings]
    return wrapped(pieces)


def wrapped(pieces: Iterable[str]) -> str:
    """Paragraphs of HTML in the page's own style."""
    paragraphs = "".join(
        f'<div style="margin-top:0.6em">{piece}</div>' for piece in pieces if piece
    )
    return f'<div style="{_STYLE}">{paragraphs}</div>'


def _state(view: RunView, directory: Path) -> str:
    if view.state is RunState.FINISHED:
        return "<b>The run is finished.</b>"
    if view.state is RunState.INTERRUPTED:
        return (
            "<b>The run is not finished, and nobody works on it.</b> Go on with: "
            f"<code>estimator resume {escape(str(directory))}</code>"
        )
    return "<b>The run goes on.</b>"


def _verdict(posterior: PosteriorSummary) -> str:
    verdict = escape(posterior.verdict)
    if not posterior.explained:
        return f'<b style="color:#c92a2a">{verdict}</b>'
    if posterior.probability is None:
        return f"{verdict} How sure the attachments are is not known yet: {posterior.not_known}."
    return f"{verdict} The attachments are <b>{100 * posterior.probability:.0f} %</b> sure."


def _legs(view: RunView) -> str:
    result, posterior = view.result, view.result.posterior
    if not result.legs:
        return "Nothing is known of the legs yet."
    rows = []
    for number, (leg, length) in enumerate(zip(result.legs, result.leg_intervals, strict=True)):
        rows.append(
            (
                f'<span style="color:{leg_colour(number)}">⬤</span> {escape(leg.joint)}',
                escape(leg.mount),
                f"{1000 * length.median:.0f} mm",
                f"{1000 * length.low:.0f}–{1000 * length.high:.0f}",
                leg.touched_in_words,
            )
        )
    between = "all models" if posterior is None else "90 %"
    return _table(("leg", "mount", "length", between, "touched"), rows)


def _movements(view: RunView) -> str:
    """Why each movement was made, and what it told; the latest first."""
    posterior = view.result.posterior
    steps = () if posterior is None else posterior.steps
    rows = []
    for number, item in enumerate(view.interactions):
        told = [] if item.bits is None else [f"{item.bits:.1f} bits expected"]
        if number < len(steps):
            if (gained := steps[number].gained_bits) is not None:
                told.append(f"{gained:.1f} bits gained")
            sure = steps[number].probability
            told.append("not known how sure" if sure is None else f"then {100 * sure:.0f} % sure")
            if not steps[number].explained:
                told.append("but not explained")
        small = f'<br><span style="opacity:0.7">{", ".join(told)}</span>' if told else ""
        rows.append((f"{number + 1}", escape(item.reason or _angles(item)) + small))
    return _table(("", "movement"), rows[::-1]) if rows else ""


def _angles(interaction: InteractionRecord) -> str:
    angles = (f"{round(math.degrees(angle)):+d}°" for angle in interaction.program)
    return ", ".join(angles).replace("-", "−")


def _table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    cells = [
        "".join(f'<{kind} style="{_CELL}">{cell}</{kind}>' for cell in row)
        for kind, row in [("th", header), *(("td", row) for row in rows)]
    ]
    return f"<table>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"


def _capital(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]
