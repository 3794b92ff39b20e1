"""The text of the live page: verdict, progress, legs, and why each movement was made."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from estimator.identification.method import information_in_words
from estimator.report.canvas import leg_colour
from estimator.report.live.run_view import RunView
from estimator.report.page.templates import render
from estimator.storage.records import InteractionRecord

_TEMPLATE = "live_panel.html"


def panel(view: RunView, directory: Path) -> str:
    """Returns the panel of a run as HTML."""
    movements = list(_movements(view))[::-1]
    return render(
        _TEMPLATE,
        sentence="",
        view=view,
        directory=directory,
        movements=movements,
        leg_colour=leg_colour,
    )


def sentence_alone(sentence: str) -> str:
    """Returns the panel with a sentence in place of all numbers."""
    return render(_TEMPLATE, sentence=sentence)


def _movements(view: RunView) -> Iterator[dict[str, Any]]:
    """Number and reason of each movement, and the information in it."""
    posterior = view.result.posterior
    steps = () if posterior is None else posterior.steps
    for index, movement in enumerate(view.interactions):
        notes = [] if movement.bits is None else [information_in_words(movement.bits)]
        if index < len(steps):
            step = steps[index]
            if step.information_gain_bits is not None:
                notes.append(f"{step.information_gain_bits:.1f} bits gained")
            if step.probability is None:
                notes.append("probability not known")
            else:
                notes.append(f"then {100 * step.probability:.0f} % probable")
            if not step.explained:
                notes.append("but not explained")
        yield {"number": index + 1, "reason": movement.reason or _angles(movement), "notes": notes}


def _angles(interaction: InteractionRecord) -> str:
    angles = (f"{round(math.degrees(angle)):+d}°" for angle in interaction.program)
    return ", ".join(angles).replace("-", "−")
