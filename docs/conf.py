"""The documentation as a site: ``make docs``."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

_ROOT = Path(__file__).parents[1]

project = "bodyschema"
copyright = "2026, the bodyschema authors"
release = tomllib.loads((_ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
    "version"
]
extensions = ["myst_parser", "sphinx_copybutton"]
myst_heading_anchors = 4
exclude_patterns = ["reproduction", "runs"]
html_theme = "furo"
html_title = f"bodyschema {release}"
copybutton_prompt_text = r"\$ |robot\$ |workstation\$ |# "
copybutton_prompt_is_regexp = True


def setup(app: Sphinx) -> None:
    """Shows CSV and hexadecimal bytes as they are: Pygments knows neither."""
    for language in ("csv", "hex"):
        app.add_lexer(language, TextLexer)
    app.connect("source-read", _unlink_readme)


def _unlink_readme(app: Sphinx, name: str, source: list[str]) -> None:
    """Leaves the words of links to README.md, which is no page of the site."""
    source[0] = re.sub(r"\[([^]]+)\]\(\.\./README\.md[^)]*\)", r"\1", source[0])
