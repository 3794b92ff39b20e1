"""The docstring of each program's package names all of its subpackages, and none that is gone."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("program", ["estimator", "protocol", "robot", "sim_robot"])
def test_a_front_page_names_the_subpackages(program: str) -> None:
    page = ROOT / program / "__init__.py"
    said = ast.get_docstring(ast.parse(page.read_text("utf-8"))) or ""
    for path in page.parent.glob("*/__init__.py"):
        assert f"``{path.parent.name}``" in said
    for name in re.findall(r"^``(\w+)``", said.partition("\nSubpackage ")[2], re.MULTILINE):
        assert (page.parent / name).is_dir() or (page.parent / f"{name}.py").exists(), name
