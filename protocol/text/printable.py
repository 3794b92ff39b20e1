"""Escapes text from elsewhere for a terminal."""

from __future__ import annotations


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
