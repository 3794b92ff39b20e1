"""Text from elsewhere, escaped for a terminal and no longer than anybody reads."""

from __future__ import annotations

from typing import Final

LONGEST: Final = 500
"""Characters that ``brief`` leaves of a text."""


def printable(text: str, *, keep: str = "") -> str:
    """The text with every character that is not printable shown as an escape.

    A name with an escape sequence in it can then neither recolour a terminal nor forge a line.

    Args:
        text: Anything.
        keep: Characters to leave as they are, such as line feeds.
    """
    return "".join(
        char
        if char.isprintable() or char in keep
        else char.encode("unicode_escape", "surrogatepass").decode()
        for char in text
    )


def brief(text: str, longest: int = LONGEST) -> str:
    """The text, or its beginning and how long it was."""
    if len(text) <= longest:
        return text
    ending = f"… ({len(text):,} characters)"
    return text[: longest - len(ending)] + ending


def told(error: BaseException) -> str:
    """Kind and text of an error that others raised, whatever they made of it."""
    try:
        text = brief(str(error))
    except BaseException as unspeakable:  # of theirs, too
        text = f"its text cannot be had: {type(unspeakable).__name__}"
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
