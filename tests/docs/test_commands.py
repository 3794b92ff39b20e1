"""Every command on every page is one that its program takes: read as it would be, not run."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import re
import shlex
from typing import Any

import pytest
import typer

from estimator.cli.command_line import app
from robot.cli.command_line import main as robotd
from sim_robot.command_line import main as sim_robotd
from tests.docs.pages import ROOT

PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "protocol" / "SPEC.md",
    *sorted((ROOT / "docs").glob("*.md")),
]
PROMPT = re.compile(r"^(?:robot\$|workstation\$|\$|#)? *(?:/opt/bodyschema/bin/)?")
PROGRAM = re.compile(
    r"(?:estimator|robotd|sim-robotd|python -m (?:protocol|sim_robot|bench)\S*|make) "
)


class ParsedError(Exception):
    """The arguments were understood, which is all that is asked here."""


def commands() -> list[Any]:
    """Each command with the page that it is on, without what a shell makes of it."""
    found = {}
    for path in PAGES:
        text = path.read_text(encoding="utf-8").replace("\\\n", " ")
        fenced = re.findall(r"^```(\w*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
        code = "".join(lines for language, lines in fenced if language in ("", "sh"))
        code += "".join(re.findall(r"^    \S.*\n", text, re.MULTILINE))
        for line in code.splitlines():
            command = PROMPT.sub("", line.strip())
            if PROGRAM.match(command):
                words = shlex.split(re.split(r" [>&|] ?|  +#| && ", command)[0].rstrip(" &"))
                if not {"…", "..."} & set(words):
                    found[tuple(words)] = path.name
    return [pytest.param(words, id=f"{page}: {' '.join(words)}") for words, page in found.items()]


@pytest.mark.parametrize("words", commands())
def test_a_command_is_understood(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    program, *rest = words
    if program == "make":
        makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
        for target in (word for word in rest if "=" not in word):
            assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
    elif program == "estimator":
        name, *options = rest
        group: Any = typer.main.get_command(app)
        group.commands[name].make_context(name, options)
    else:
        understood = argparse.ArgumentParser.parse_args

        def parse(parser: argparse.ArgumentParser, *args: Any) -> None:
            understood(parser, *args)
            raise ParsedError

        monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse)
        main = {"robotd": robotd, "sim-robotd": sim_robotd}.get(program)
        if main is None:
            _, name, *rest = rest
            package = importlib.util.find_spec(f"{name}.__main__") if "." not in name else None
            main = importlib.import_module(f"{name}.__main__" if package else name).main
        with pytest.raises(ParsedError):
            main(rest)
