"""The docstring of a package names all of its modules, and no others."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = {
    page: docstring
    for program in ("estimator", "protocol", "robot", "sim_robot")
    for page in sorted((ROOT / program).rglob("__init__.py"))
    if "=====" in (docstring := ast.get_docstring(ast.parse(page.read_text("utf-8"))) or "")
}
OF_NAMES = {ROOT / "estimator" / "__init__.py", ROOT / "protocol" / "__init__.py"}
"""Tables of what a program may import, not of modules."""


def modules(page: Path) -> set[str]:
    folders = {path.parent.name for path in page.parent.glob("*/__init__.py")}
    return {path.stem for path in page.parent.glob("[!_]*.py")} | folders


@pytest.mark.parametrize(
    "page", sorted(set(PAGES) - OF_NAMES), ids=lambda page: str(page.parent.relative_to(ROOT))
)
def test_a_front_page_is_complete(page: Path) -> None:
    named = {name.split(".")[0] for name in re.findall(r"``([a-z_][\w.]*)``", PAGES[page])}
    assert modules(page) - named == set()


def test_a_front_page_names_nothing_that_is_gone() -> None:
    for page in set(PAGES) - OF_NAMES:
        rows = re.findall(r"^``([a-z_0-9]+)(?:\.\w+)?``  ", PAGES[page], re.MULTILINE)
        assert set(rows) - modules(page) == set(), page
    assert len(PAGES) > 30
