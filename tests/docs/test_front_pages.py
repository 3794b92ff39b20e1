"""Front pages are true: what they name is in the package, all of it, in the order of imports.

The docstring of a package that has subpackages lists them in its last table or, where that is about
something else, in its last sentence. The order is that of pyproject.toml, where it has one.
"""

from __future__ import annotations

import ast
import re
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

from tests.docs.pages import ROOT, section

PROGRAMS = ("estimator", "protocol", "robot", "sim_robot")
PACKAGES = [
    *(ROOT / program for program in PROGRAMS),
    *(
        path.parent
        for program in ("estimator", "robot", "sim_robot")
        for path in sorted((ROOT / program).glob("**/__init__.py"))
        if path.parent.name != program and any(path.parent.glob("*/__init__.py"))
    ),
]


def name_of(package: Path) -> str:
    return ".".join(package.relative_to(ROOT).parts)


def docstring(package: Path) -> str:
    return ast.get_docstring(ast.parse((package / "__init__.py").read_text("utf-8"))) or ""


def listed(said: str) -> list[str]:
    """What a docstring lists, from the top down."""
    tables = re.findall(r"^Name +What is in it\n=+ =+\n(.*?)^=", said, re.DOTALL | re.MULTILINE)
    if tables:
        return re.findall(r"^``(\w+)``", tables[-1], re.MULTILINE)
    return re.findall(r"``(\w+)``", said.rpartition(": ")[2])


def subpackages(package: Path) -> set[str]:
    return {path.parent.name for path in package.glob("*/__init__.py")}


def contents(package: Path) -> set[str]:
    """Subpackages and modules."""
    modules = {path.stem for path in package.glob("*.py")} - {"__init__", "__main__"}
    return modules | subpackages(package)


def depths(package: Path) -> dict[str, int]:
    """The layer of each name by pyproject.toml, 0 at the top; empty where it says nothing."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    for contract in settings["tool"]["importlinter"]["contracts"]:
        if contract["type"] == "layers" and contract["containers"] == [name_of(package)]:
            return {
                name: depth
                for depth, layer in enumerate(contract["layers"])
                for name in re.findall(r"\w+", layer)
            }
    return {}


def assert_in_order(names: list[str], package: Path) -> None:
    order = depths(package)
    for above, below in pairwise(names if order else ()):
        assert order[above] <= order[below], (above, below)


@pytest.mark.parametrize("package", PACKAGES, ids=name_of)
def test_a_front_page_names_what_is_there_in_order(package: Path) -> None:
    said = docstring(package)
    names = listed(said)
    assert subpackages(package) <= set(names) <= contents(package)
    assert len(set(names)) == len(names)
    assert contents(package) <= set(re.findall(r"``(\w+)``", said))
    assert_in_order(names, package)


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_architecture_names_what_is_there_in_order(program: str) -> None:
    header, _, *rows = re.findall(r"^\|.*\|$", section("architecture", "Subpackages"), re.MULTILINE)
    column = re.findall(r"`(\w+)/`", header).index(program)
    cells = [row.strip("|").split("|")[column] for row in rows]
    drawn = [name for cell in cells for name in re.findall(r"`([\w.]+)`", cell)]
    names = [name.removesuffix(".py") for name in drawn]
    package = ROOT / program
    assert sorted(names) == sorted(contents(package))
    assert {name for name in drawn if not name.endswith(".py")} == subpackages(package)
    assert_in_order(names, package)
