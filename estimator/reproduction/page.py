"""``report.html`` of a reproduction: ``report.md`` and its pictures as one page."""

from __future__ import annotations

from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup

from estimator.errors import RunDirectoryError
from estimator.report.page.templates import picture, render
from estimator.reproduction.report import REPORT


def reproduction_page(root: Path) -> str:
    """The page as HTML.

    Args:
        root: The reproduction's directory.

    Raises:
        RunDirectoryError: There is no report.
    """
    try:
        text = (root / REPORT).read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RunDirectoryError(
            f"{root} holds no reproduction: {REPORT} cannot be read ({error}). Make one with "
            f"`estimator reproduce all --out {root}`; of a single run, leave out --paper."
        ) from error
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(text)
    for token in tokens:
        for item in token.children or ():
            _contain(item, root)
    body = Markup(parser.renderer.render(tokens, parser.options, {}))  # the parser escapes all HTML
    return render("reproduction.html", body=body)


def _contain(item: Token, root: Path) -> None:
    """Takes a picture into the page; one that is not there keeps its text."""
    if item.type != "image":
        return
    file = root / Path(str(item.attrs["src"])).name
    item.attrs["src"] = picture(file.read_bytes()) if file.is_file() else ""
