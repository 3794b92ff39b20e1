"""One colour, marker and label per leg, the same in every plot, picture, table and page."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from typing import Final

from protocol.text import printable

MARKERS: Final = {"left": "<", "front": "^", "right": ">", "back": "v"}
"""The paper's arrows: left, forward, right and back leg."""

OTHER_MARKERS: Final = ("s", "D", "P", "X", "*", "p", "h", "d")
"""For legs on a mount that has its arrow already, or on none of the four; then come numbers."""

COLOURS: Final = (
    *("#0072b2", "#d55e00", "#009e73", "#cc79a7"),
    *("#e69f00", "#56b4e9", "#5e3c99", "#8c510a"),
)
"""Told apart by the colour-blind."""

_GOLDEN: Final = 0.381966  # of a circle: however many hues are taken in such steps, none recurs
_LIGHTNESS: Final = (0.33, 0.52, 0.70)
_LONGEST: Final = 20  # characters of a name in a legend


def leg_colour(leg: int) -> str:
    """The colour of a leg, by its motor's place in motor order, as ``#rrggbb``."""
    if leg < len(COLOURS):
        return COLOURS[leg]
    further = leg - len(COLOURS)
    lightness = _LIGHTNESS[further % len(_LIGHTNESS)]
    channels = colorsys.hls_to_rgb(further * _GOLDEN % 1, lightness, 0.6)
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in channels)


def leg_label(name: str) -> str:
    """A name as a legend takes it: printable, short, without the underscore that would hide it."""
    short = name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…"
    return printable(f" {short}" if short.startswith("_") else short)


def leg_markers(mounts: Sequence[str]) -> list[str]:
    """A matplotlib marker for each leg, no two the same.

    Args:
        mounts: Where each leg sits. The first on each of the paper's four has its arrow.
    """
    markers: list[str] = []
    for leg, mount in enumerate(mounts, 1):
        wanted = [MARKERS[mount]] if mount in MARKERS else []
        free = [mark for mark in (*wanted, *OTHER_MARKERS) if mark not in markers]
        markers.append(free[0] if free else f"${leg}$")
    return markers
