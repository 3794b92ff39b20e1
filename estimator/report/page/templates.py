"""Pages from templates: one file each, everything escaped, nothing fetched.

Names, problems and sentences come from robots and files that others made. Templates escape all of
them, and each page forbids its reader's browser to load anything or to run any script but the
page's own.
"""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from importlib import resources
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from protocol.text import printable

_FILES: Final = resources.files("estimator.report.page")


def render(template: str, **values: object) -> str:
    """Returns a page as HTML.

    Args:
        template: Name of the template, a file of this package.
        **values: Values of the variables in the template.
    """
    return _environment().get_template(template).render(**values)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("estimator.report", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_visible,
    )
    environment.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    environment.globals |= {"own": own, "script_hash": script_hash}
    environment.filters |= {
        "mm": lambda length: f"{1000 * length:.1f}",
        "bits": lambda bits: "–" if bits is None else f"{bits:.1f}",
        "picture": picture,
    }
    return environment


def own(name: str) -> Markup:
    """Returns a file of this package unescaped: a style sheet or a script."""
    return Markup(_text(name))  # safe: no text from outside


def script_hash(name: str) -> str:
    """Hash of a script of this package, by which a page's security policy allows it to run."""
    digest = hashlib.sha256(_text(name).encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def picture(png: bytes) -> str:
    """Returns a PNG as a data URL."""
    return f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"


def _text(name: str) -> str:
    return (_FILES / name).read_text("utf-8")


def _visible(value: Any) -> Any:
    """Escapes what is not printable in text, since it could reverse or hide the rest."""
    return printable(value, keep="\n") if type(value) is str else value
