"""Whatever file or page our documentation names is there."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from tests.docs.pages import ROOT

PAGES = [*sorted(ROOT.glob("*.md")), ROOT / "protocol" / "SPEC.md", *sorted(ROOT.glob("docs/*.md"))]
PACKAGES = ("protocol", "robot", "sim_robot", "estimator", "tests", "bench")
OURS = re.compile(rf"`((?:{'|'.join(PACKAGES)}|docs)/[\w./-]+)")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_paths_and_links_of_a_page_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = {ROOT / path.rstrip(".") for path in OURS.findall(text)}
    linked = {
        page.parent / link
        for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text)
        if "://" not in link
    }
    assert not sorted(str(path) for path in named | linked if not path.exists())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_modules_of_a_page_are_there_also_where_their_package_goes_without_saying(
    page: Path,
) -> None:
    text = page.read_text(encoding="utf-8")
    modules = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    named = set(re.findall(r"`(\w+(?:/\w+)+\.py)`", text))
    assert not {name for name in named if not any(path.match(name) for path in modules)}


def test_the_names_in_the_architecture_are_in_our_code() -> None:
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    words = {word for path in files for word in re.findall(r"\w+", path.read_text("utf-8"))}
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert not set(re.findall(r"`(\w+)`", text)) - words


def test_targets_that_are_named_to_contributors_exist() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = set(re.findall(r"`make ([\w-]+)`", text))
    assert named >= {"check", "test"}
    assert named <= set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE))


def test_the_changelog_has_the_present_version_and_keeps_its_format() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "version"
    ]
    assert re.findall(r"^## \[(.+?)\]", text, re.MULTILINE)[:2] == ["Unreleased", version]
    kinds = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"^### (.+)$", text, re.MULTILINE)) <= kinds
