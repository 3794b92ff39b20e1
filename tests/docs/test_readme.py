"""README and first page are true: their commands are run, in order, in an empty folder."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import chdir, nullcontext
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench.daemons import simulator
from estimator.cli.command_line import app
from tests.docs.pages import ROOT, blocks, page, section
from tests.estimator.little_effort import little_effort

ADDRESS = "tcp://127.0.0.1:5750"
README = (ROOT / "README.md").read_text(encoding="utf-8")
# The same commands on a smaller budget: what is tested is that they do what is said. With
# ALL_EFFORT, as `make docs-commands` has it, they are run as they stand.
ALL_EFFORT = bool(os.environ.get("ALL_EFFORT"))
PAPER = " --population 8 --generations 1"
SHORTER = (
    ("--interactions 6", "--interactions 1"),
    ("--robot (replay|file):", r"--method paper --robot \1:"),
    (r"^(.* --method paper .*)$", rf"\1{PAPER}"),
)


def run(line: str) -> str:
    """What a command prints; ``estimator`` is called in this process and makes little effort."""
    name, *words = shlex.split(line)
    if name != "estimator":
        return subprocess.run(
            ["bash", "-ec", line],
            env=os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
            timeout=120,
        ).stdout
    jobs = ("--jobs", "1") if words[0] in ("identify", "resume", "validate", "score") else ()
    with nullcontext() if ALL_EFFORT else little_effort():
        ended = CliRunner().invoke(app, [*words, *jobs])
    assert ended.exit_code == 0, (line, ended.output)
    return ended.stdout


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (README, ("clearance: ",)),
        (page("first-steps"), ("Mean leg error", "Prediction error")),
    ],
    ids=["README", "first-steps"],
)
def test_the_commands_and_the_program_run(
    text: str, said: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    script, (python,) = "".join(blocks(text, "sh")), blocks(text, "python")
    for command, shorter in () if ALL_EFFORT else SHORTER:
        script = re.sub(command, shorter, script, flags=re.MULTILINE)
    start, *lines = script.splitlines()
    name, bind, address, *options, in_background = start.split()
    assert (name, bind, in_background) == ("sim-robotd", "--bind", "&")
    with simulator(*options) as robot:
        printed = "".join(run(line.replace(address, robot.uri)) for line in lines)
        (tmp_path / "program.py").write_text(python.replace(address, robot.uri))
        printed += run("python program.py")
    for words in said:
        assert words in printed


def test_the_readme_is_short_and_its_make_targets_and_links_exist() -> None:
    assert len(README.splitlines()) <= 150
    targets = re.findall(r"^make (\w+)", "".join(blocks(README, "")), flags=re.MULTILINE)
    assert targets == ["demo", "test"]
    for target in [*targets, "docs", "help"]:
        subprocess.run(["make", "-n", target], cwd=ROOT, check=True, capture_output=True)
    for link in re.findall(r"\]\(([^)#]+)[^)]*\)", README):
        assert (ROOT / link).exists(), link


@pytest.fixture(scope="module")
def first_run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, str]]:
    """What README's run prints, with all the effort of a user's run, and where its robot is."""
    start, identify, *_ = "".join(blocks(README, "sh")).splitlines()
    with chdir(tmp_path_factory.mktemp("readme")), simulator(*start.split()[3:-1]) as robot:
        yield printed(identify, robot.uri, "--jobs", "2"), robot.uri


def printed(line: str, uri: str, *options: str) -> str:
    words = [*line.replace(ADDRESS, uri).split()[1:], *options]
    ended = CliRunner().invoke(app, words, env={"COLUMNS": "200"})
    assert ended.exit_code == 0, (line, ended.output)
    return ended.stdout.replace(uri, ADDRESS)


def skeleton(text: str) -> str:
    """A text without its figures, which may differ from machine to machine."""
    return re.sub(r"[ \d.>-]+", " ", re.sub(r" +$", "", text, flags=re.MULTILINE)).strip()


def test_what_the_readme_says_is_printed(first_run: tuple[str, str]) -> None:
    stdout, _ = first_run
    (shown,) = blocks(README, "text")
    assert skeleton(stdout).startswith(skeleton(shown.rstrip().removesuffix("…")))


def test_the_first_pose_is_taken_by_the_readmes_robot(first_run: tuple[str, str]) -> None:
    _, uri = first_run
    text = section("after", "Poses on demand")
    (command,), shown = blocks(text, "sh"), blocks(text, "text")
    assert [skeleton(printed(command, uri, "--yes", "--jobs", "1"))] == list(map(skeleton, shown))
